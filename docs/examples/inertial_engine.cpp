// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
//
// A small engine that is a program: the IMU alone carries the state, standing still stops it, and of a picture it only
// looks whether there is something in it. It drifts; it is there to test with, and to begin with one of your own:
//     g++ -std=c++17 -O2 -I "$(viso engine)" inertial_engine.cpp -o inertial_engine
//     viso vio SOURCE --engine ./inertial_engine

#include <viso_engine.hpp>

#include <algorithm>
#include <cmath>

using viso::Matrix4;
using viso::Vector3;

namespace {

constexpr double STILL_GYRO = 0.05, STILL_ACCEL = 0.5;  // rad/s, m/s^2: more is motion
constexpr std::uint32_t SIDE = 8;                       // cells of a picture along a side
constexpr std::uint64_t KEYFRAME_IMAGES = 5;

double norm(const Vector3& a) { return std::hypot(a[0], a[1], a[2]); }

Matrix4 product(const Matrix4& a, const Matrix4& b) {
    Matrix4 c{};
    for (int i = 0; i < 16; i++)
        for (int k = 0; k < 4; k++) c[i] += a[i / 4 * 4 + k] * b[k * 4 + i % 4];
    return c;
}

Matrix4 inverse(const Matrix4& a) {
    Matrix4 b = viso::IDENTITY;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            b[4 * i + k] = a[4 * k + i];
            b[4 * i + 3] -= a[4 * k + i] * a[4 * k + 3];
        }
    return b;
}

// The turn by a rotation vector.
Matrix4 turn(const Vector3& r) {
    const double angle = norm(r), s = angle < 1e-9 ? 1 : std::sin(angle) / angle;
    const double c = angle < 1e-9 ? 0.5 : (1 - std::cos(angle)) / (angle * angle);
    const Matrix4 k = {0, -r[2], r[1], 0, r[2], 0, -r[0], 0, -r[1], r[0], 0, 0, 0, 0, 0, 0}, kk = product(k, k);
    Matrix4 m = viso::IDENTITY;
    for (int i = 0; i < 16; i++) m[i] += s * k[i] + c * kk[i];
    return m;
}

class InertialEngine : public viso::Engine {
public:
    void set_up(const viso::Setup& setup, viso::Options& options, const std::vector<std::uint8_t>&) override {
        gravity_ = setup.gravity;
        fewest_cells_ = options.number("fewest_cells", 8);
        options.expect_no_others();
    }

    void reset(const viso::Start* start) override {
        *this = InertialEngine(needs_motion_, gravity_, fewest_cells_);
        if (!start) return;
        has_state_ = is_told_ = true;
        pose_ = start->world_T_body;
        velocity_ = start->velocity_world;
        accel_bias_ = start->accel_bias;
        gyro_bias_ = start->gyro_bias;
    }

    void add_imu(const viso::Imu& sample) override { samples_.push_back(sample); }

    viso::Estimate add_image(const viso::Image& image) override {
        advance(image.t_ns);
        viso::Estimate estimate;
        if (!has_state_) has_state_ = needs_motion_ ? moved_s_ > 0.05 : still_s_ > 0.15;
        if (!has_state_) return estimate;
        if (images_ == 0) keyframe_ = pose_;
        const std::uint32_t cells = cells_with_contrast(image);
        estimate.status = cells < fewest_cells_ ? viso::Status::LOST : viso::Status::TRACKING;
        estimate.world_T_body = pose_;
        estimate.keyframe_T_body = product(inverse(keyframe_), pose_);
        estimate.velocity_world = velocity_;
        estimate.accel_bias = accel_bias_;
        estimate.gyro_bias = gyro_bias_;
        estimate.tracked = estimate.inliers = cells;
        estimate.coverage = static_cast<double>(cells) / (SIDE * SIDE);
        estimate.covariance_kind = viso::CovarianceKind::RELATIVE;
        for (int i = 0; i < 6; i++) estimate.covariance[7 * i] = i < 3 ? 1e-6 : 1e-2;
        estimate.is_keyframe = images_++ % KEYFRAME_IMAGES == 0;
        if (estimate.is_keyframe) keyframe_ = pose_;
        return estimate;
    }

    explicit InertialEngine(bool needs_motion, double gravity = 0, double fewest_cells = 0)
        : needs_motion_(needs_motion), gravity_(gravity), fewest_cells_(fewest_cells) {}

private:

    // Carry the state on to the stamp of an image; what was told holds at the first one.
    void advance(std::int64_t to_ns) {
        for (const viso::Imu& sample : samples_) {
            const std::int64_t t_ns = std::min(sample.t_ns, to_ns);
            if (last_ns_ != 0 && t_ns > last_ns_) step(sample, 1e-9 * static_cast<double>(t_ns - last_ns_));
            last_ns_ = std::max(last_ns_, t_ns);
        }
        samples_.erase(samples_.begin(), std::find_if(samples_.begin(), samples_.end(), [=](const viso::Imu& sample) {
            return sample.t_ns > to_ns;
        }));
        last_ns_ = to_ns;
        is_told_ = false;
    }

    void step(const viso::Imu& sample, double dt) {
        Vector3 angle, force;
        for (int i = 0; i < 3; i++) {
            angle[i] = (sample.gyro[i] - gyro_bias_[i]) * dt;
            force[i] = sample.accel[i] - accel_bias_[i];
        }
        const bool still = norm(angle) < STILL_GYRO * dt && std::abs(norm(force) - gravity_) < STILL_ACCEL;
        still_s_ = still ? still_s_ + dt : 0;
        moved_s_ = still ? 0 : moved_s_ + dt;
        if (!has_state_ || is_told_) return;
        for (int i = 0; i < 3; i++) {
            double accel = i == 2 ? -gravity_ : 0;
            for (int k = 0; k < 3; k++) accel += pose_[4 * i + k] * force[k];
            velocity_[i] += accel * dt;
            pose_[4 * i + 3] += velocity_[i] * dt;
        }
        pose_ = product(pose_, turn(angle));
    }

    static std::uint32_t cells_with_contrast(const viso::Image& image) {
        std::array<std::uint8_t, SIDE * SIDE> darkest, brightest{};
        darkest.fill(255);
        for (std::uint32_t y = 0; y < image.height; y++)
            for (std::uint32_t x = 0; x < image.width; x++) {
                const std::uint32_t cell = y * SIDE / image.height * SIDE + x * SIDE / image.width;
                const std::uint8_t value = image.pixels[std::size_t{y} * image.width + x];
                darkest[cell] = std::min(darkest[cell], value);
                brightest[cell] = std::max(brightest[cell], value);
            }
        std::uint32_t count = 0;
        for (std::size_t i = 0; i < darkest.size(); i++) count += brightest[i] > darkest[i] + 20;
        return count;
    }

    bool needs_motion_, has_state_ = false, is_told_ = false;
    double gravity_, fewest_cells_;
    std::vector<viso::Imu> samples_;
    std::int64_t last_ns_ = 0;
    double still_s_ = 0, moved_s_ = 0;
    std::uint64_t images_ = 0;
    Matrix4 pose_ = viso::IDENTITY, keyframe_ = viso::IDENTITY;
    Vector3 velocity_{}, accel_bias_{}, gyro_bias_{};
};

}  // namespace

int main(int count, char** words) {
    const bool needs_motion = count > 1 && std::string(words[1]) == "--needs-motion";  // as some engines do
    return viso::run([=] { return std::make_unique<InertialEngine>(needs_motion); }, "inertial",
                     viso::HAS_COVARIANCE | (needs_motion ? 0 : viso::STARTS_AT_REST), 0, 50);
}
