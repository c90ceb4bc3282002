// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
//
// VINS-Mono as a program that viso runs. docs/engines.md tells which headers and libraries it wants; VINS_MONO_ROOT is
// where VINS-Mono's sources are. VINS-Mono is under GPL-3.0-only, and so is the program that is linked with it.
//
// VINS-Mono's settings are globals, which it reads from a file through ROS; here they are defined and set. Its rotation
// errors are on the right, in the body.

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <vins_estimator/src/estimator.h>

#include <camodocal/camera_models/EquidistantCamera.h>
#include <camodocal/camera_models/PinholeCamera.h>

// The two halves are two programs with names in common. Those of the front end are linked with a prefix.
#define ROW tracker_ROW
#define COL tracker_COL
#define FOCAL_LENGTH tracker_FOCAL_LENGTH
#define WINDOW_SIZE tracker_WINDOW_SIZE
#define NUM_OF_CAM tracker_NUM_OF_CAM
#define TicToc TrackerTicToc
#include <feature_tracker/src/feature_tracker.h>
#undef ROW
#undef COL
#undef FOCAL_LENGTH
#undef WINDOW_SIZE
#undef NUM_OF_CAM
#undef TicToc

#include "adapter.hpp"

double INIT_DEPTH = 5;
double MIN_PARALLAX = 0;
int ESTIMATE_EXTRINSIC = 0, ESTIMATE_TD = 0, ROLLING_SHUTTER = 0;
double ACC_N = 0, ACC_W = 0, GYR_N = 0, GYR_W = 0;
std::vector<Eigen::Matrix3d> RIC;
std::vector<Eigen::Vector3d> TIC;
Eigen::Vector3d G(0, 0, 9.81);
double BIAS_ACC_THRESHOLD = 0.1, BIAS_GYR_THRESHOLD = 0.1;
double SOLVER_TIME = 0;
int NUM_ITERATIONS = 0;
std::string EX_CALIB_RESULT_PATH, VINS_RESULT_PATH;
double TD = 0, TR = 0, ROW = 0, COL = 0;

std::string IMAGE_TOPIC, IMU_TOPIC, FISHEYE_MASK;
std::vector<std::string> CAM_NAMES;
int tracker_ROW = 0, tracker_COL = 0, tracker_FOCAL_LENGTH = 460, tracker_WINDOW_SIZE = 20;
int MAX_CNT = 0, MIN_DIST = 0, FREQ = 0, SHOW_TRACK = 0, STEREO_TRACK = 0, EQUALIZE = 0, FISHEYE = 0;
double F_THRESHOLD = 1;
bool PUB_THIS_FRAME = true;

namespace {

using adapter::Pose;

constexpr unsigned MOST_FEATURES = 200;  // more of them overrun VINS-Mono's NUM_OF_F in a window
constexpr int NEWEST = WINDOW_SIZE - 1;  // of the poses in the window after it has slid
constexpr int OLDEST_KEYFRAME = 2;       // K must not leave the window before there is another
constexpr int PASSES = 3;                // of triangulation and optimisation after a given start
constexpr double FAR_M = 1e4;            // a depth beyond is none
constexpr double USUAL_WIDTH_PX = 752;   // of the pictures that VINS-Mono's usual distance between points is for
constexpr double USUAL_RATE_HZ = 200;
constexpr double FIXED = 1e10;           // information of what is held
constexpr int STATE = 15;                // degrees of freedom: pose, velocity, biases
constexpr int STATES = STATE * WINDOW_SIZE;
constexpr std::int64_t FIRST_NS = 1'000'000'000;  // of VINS-Mono's clock, which must not begin at zero

// VINS-Mono counts on memory that is zero before its constructor runs.
Estimator estimator;

// What VINS-Mono measures with, in the terms of its constants.
double pixels(double normalised_sigmas, double focal_px) {
    return normalised_sigmas / ProjectionFactor::sqrt_info(0, 0) * focal_px;
}

camodocal::CameraPtr camera_of(const viso::Setup& setup) {
    const auto& k = setup.distortion;
    const int width = static_cast<int>(setup.width), height = static_cast<int>(setup.height);
    if (setup.distortion_model == viso::Distortion::EQUIDISTANT)
        return camodocal::CameraPtr(new camodocal::EquidistantCamera("camera", width, height, k[0], k[1], k[2], k[3],
                                                                     setup.fx, setup.fy, setup.cx, setup.cy));
    if (k[4] != 0) throw std::invalid_argument("VINS-Mono has no third radial coefficient");
    return camodocal::CameraPtr(new camodocal::PinholeCamera("camera", width, height, k[0], k[1], k[2], k[3], setup.fx,
                                                             setup.fy, setup.cx, setup.cy));
}

class VinsMono final : public viso::Engine {
public:
    void set_up(const viso::Setup& setup, viso::Options& options, const std::vector<std::uint8_t>& mask) override {
        setup_ = setup;
        const double rate_hz = setup.imu_rate_hz > 0 ? setup.imu_rate_hz : USUAL_RATE_HZ;
        ACC_N = setup.accel_noise * std::sqrt(rate_hz);  // deviations of a sample, not densities
        GYR_N = setup.gyro_noise * std::sqrt(rate_hz);
        ACC_W = setup.accel_walk * std::sqrt(rate_hz);
        GYR_W = setup.gyro_walk * std::sqrt(rate_hz);
        G = Eigen::Vector3d(0, 0, setup.gravity);
        const Pose body_T_camera(setup.body_T_camera);
        RIC = {body_T_camera.R};
        TIC = {body_T_camera.t};
        ROW = tracker_ROW = static_cast<int>(setup.height);
        COL = tracker_COL = static_cast<int>(setup.width);
        ESTIMATE_EXTRINSIC = options.flag("estimate_extrinsics", false);
        EQUALIZE = options.flag("equalise", true);
        MIN_DIST = static_cast<int>(options.number("distance_px", 30 * setup.width / USUAL_WIDTH_PX));
        F_THRESHOLD = options.number("threshold_px", 1);
        NUM_ITERATIONS = static_cast<int>(options.number("iterations", 8));
        SOLVER_TIME = options.number("solver_time_s", 0.04);
        least_parallax_ = options.number("keyframe_parallax_px", 10) / FOCAL_LENGTH;
        options.expect_no_others();
        MAX_CNT = static_cast<int>(std::min(setup.max_features, MOST_FEATURES));
        FISHEYE = !mask.empty();
        mask_ = mask;
        cv::setNumThreads(static_cast<int>(setup.threads));
        cv::setRNGSeed(static_cast<int>(setup.seed));
    }

    void reset(const viso::Start* start) override {
        FeatureTracker::n_id = 0;
        tracker_ = FeatureTracker();
        tracker_.m_camera = camera_of(setup_);
        if (FISHEYE) tracker_.fisheye_mask = cv::Mat(tracker_ROW, tracker_COL, CV_8UC1, mask_.data()) != 0;
        estimator.clearState();
        estimator.setParameter();
        estimator.g = G;
        start_ = start ? std::make_unique<viso::Start>(*start) : nullptr;
        if (start_) {
            const Pose pose(start->world_T_body);
            estimator.Ps[0] = pose.t;
            estimator.Rs[0] = pose.R;
            estimator.Vs[0] = adapter::vector(start->velocity_world);
            estimator.Bas[0] = adapter::vector(start->accel_bias);
            estimator.Bgs[0] = adapter::vector(start->gyro_bias);
        }
        MIN_PARALLAX = least_parallax_;
        imu_.clear();
        begin_ns_ = last_imu_ns_ = 0;
        keyframe_s_ = 0;
        tracked_ = 0;
        last_ = viso::Estimate();
    }

    void add_imu(const viso::Imu& sample) override { imu_.push_back(sample); }

    viso::Estimate add_image(const viso::Image& image) override {
        const bool is_first = begin_ns_ == 0;
        if (imu_.empty() || imu_.back().t_ns < image.t_ns) return without_image();
        if (is_first) begin_ns_ = image.t_ns - FIRST_NS;
        const bool had_state = estimator.solver_flag == Estimator::NON_LINEAR;
        feed_imu(image.t_ns);
        std_msgs::Header header;
        header.stamp.fromNSec(static_cast<std::uint64_t>(image.t_ns - begin_ns_));
        const auto points = tracked_points(image, header.stamp.toSec());
        if (is_first && !start_) return viso::Estimate();  // nothing has moved yet
        if (start_ && estimator.frame_count == WINDOW_SIZE && !had_state) begin_from(*start_);
        if (estimator.solver_flag == Estimator::NON_LINEAR) settle_depths(-1);
        estimator.last_P = estimator.Ps[WINDOW_SIZE];  // a jump is one from where the IMU has led
        estimator.processImage(points, header);
        MIN_PARALLAX = least_parallax_;
        if (start_) carry_on();
        if (estimator.solver_flag == Estimator::INITIAL) {
            viso::Estimate estimate;
            if (had_state) estimate.status = viso::Status::FAILED;  // it has begun anew by itself
            keyframe_s_ = 0;
            return last_ = estimate;
        }
        start_.reset();
        return last_ = estimate_of(header.stamp.toSec());
    }

private:
    using Points = std::map<int, std::vector<std::pair<int, Eigen::Matrix<double, 7, 1>>>>;

    // Return what there is to say where the image could not be used.
    viso::Estimate without_image() {
        if (last_.is_keyframe) last_.keyframe_T_body = viso::IDENTITY;
        last_.is_keyframe = 0;
        last_.covariance_kind = viso::CovarianceKind::NONE;
        last_.inliers = 0;
        if (last_.status == viso::Status::TRACKING) last_.status = viso::Status::LOST;
        return last_;
    }

    // Hand on the samples up to a stamp, the last one interpolated there.
    void feed_imu(std::int64_t t_ns) {
        viso::Imu before = last_sample_;
        while (!imu_.empty() && imu_.front().t_ns <= t_ns) {
            before = imu_.front();
            feed(before);
            imu_.pop_front();
        }
        if (!imu_.empty() && last_imu_ns_ != 0 && last_imu_ns_ < t_ns) {
            const viso::Imu& after = imu_.front();
            const auto passed_ns = static_cast<double>(t_ns - before.t_ns);
            const double share = passed_ns / static_cast<double>(after.t_ns - before.t_ns);
            viso::Imu at = before;
            at.t_ns = t_ns;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                at.accel[axis] += share * (after.accel[axis] - before.accel[axis]);
                at.gyro[axis] += share * (after.gyro[axis] - before.gyro[axis]);
            }
            feed(at);
        }
    }

    void feed(const viso::Imu& sample) {
        const double dt_s = last_imu_ns_ == 0 ? 0 : static_cast<double>(sample.t_ns - last_imu_ns_) * 1e-9;
        last_imu_ns_ = sample.t_ns;
        last_sample_ = sample;
        estimator.processIMU(dt_s, adapter::vector(sample.accel), adapter::vector(sample.gyro));
    }

    // Return the points that were there in the image before, by their numbers.
    Points tracked_points(const viso::Image& image, double t_s) {
        tracker_.readImage(cv::Mat(static_cast<int>(image.height), static_cast<int>(image.width), CV_8UC1,
                                   const_cast<std::uint8_t*>(image.pixels)).clone(), t_s);
        for (unsigned i = 0; tracker_.updateID(i);) ++i;
        Points points;
        for (std::size_t i = 0; i < tracker_.ids.size(); ++i) {
            if (tracker_.track_cnt[i] < 2) continue;
            const cv::Point2f &ray = tracker_.cur_un_pts[i], &pixel = tracker_.cur_pts[i];
            const cv::Point2f& velocity = tracker_.pts_velocity[i];
            Eigen::Matrix<double, 7, 1> point;
            point << ray.x, ray.y, 1, pixel.x, pixel.y, velocity.x, velocity.y;
            points[tracker_.ids[i]].emplace_back(0, point);
        }
        fresh_ = static_cast<unsigned>(tracker_.ids.size() - points.size());
        lost_ = tracked_ > points.size() ? static_cast<unsigned>(tracked_ - points.size()) : 0;
        tracked_ = tracker_.ids.size();
        return points;
    }

    // While the window fills, each slot begins from the one before, and the IMU leads on from there.
    void carry_on() {
        const int slot = estimator.frame_count;
        if (slot == 0 || slot > WINDOW_SIZE) return;
        estimator.Ps[slot] = estimator.Ps[slot - 1];
        estimator.Rs[slot] = estimator.Rs[slot - 1];
        estimator.Vs[slot] = estimator.Vs[slot - 1];
        estimator.Bas[slot] = estimator.Bas[slot - 1];
        estimator.Bgs[slot] = estimator.Bgs[slot - 1];
    }

    // The window is full but for the image to come: make the start the prior of its first state, and optimise.
    void begin_from(const viso::Start& start) {
        const auto variances = adapter::variances(start);
        Eigen::Matrix<double, STATE, 1> weights;  // VINS-Mono's order: position, attitude; velocity, biases
        weights << Eigen::Vector3d::Constant(1e3),  // where it is is given
            variances.head<3>().cwiseSqrt().cwiseInverse(), variances.segment<3>(6).cwiseSqrt().cwiseInverse(),
            variances.segment<3>(12).cwiseSqrt().cwiseInverse(), variances.segment<3>(9).cwiseSqrt().cwiseInverse();
        estimator.vector2double();
        auto* prior = new MarginalizationInfo();  // of the estimator from here on
        prior->m = 0;
        prior->n = STATE;
        prior->keep_block_size = {SIZE_POSE, SIZE_SPEEDBIAS};
        prior->keep_block_idx = {0, 6};
        prior->sum_block_size = SIZE_POSE + SIZE_SPEEDBIAS;
        prior->linearized_jacobians = weights.asDiagonal();
        prior->linearized_residuals = Eigen::VectorXd::Zero(STATE);
        const std::pair<double*, int> blocks[] = {{estimator.para_Pose[0], SIZE_POSE},
                                                  {estimator.para_SpeedBias[0], SIZE_SPEEDBIAS}};
        for (const auto& [block, size] : blocks) {
            auto* data = new double[static_cast<std::size_t>(size)];
            std::copy(block, block + size, data);
            prior->parameter_block_data[reinterpret_cast<long>(block)] = data;
            prior->keep_block_data.push_back(data);
            estimator.last_marginalization_parameter_blocks.push_back(block);
        }
        estimator.last_marginalization_info = prior;
        estimator.marginalization_flag = Estimator::MARGIN_SECOND_NEW;  // nothing leaves the window here
        for (int pass = 0; pass < PASSES; ++pass) {
            estimator.f_manager.clearDepth(Eigen::VectorXd::Constant(estimator.f_manager.getFeatureCount(), -1));
            settle_depths(0);
            estimator.optimization();
        }
        estimator.solver_flag = Estimator::NON_LINEAR;
        estimator.last_R0 = estimator.Rs[0];
        estimator.last_P0 = estimator.Ps[0];
    }

    // Triangulate points that have no depth yet, and give those that get none the one that VINS-Mono has for failures:
    // at rest they are anywhere, and one at infinity is the end of the optimisation.
    // sound: 0 to keep depths that can be, -1 to leave these to VINS-Mono and the image to come.
    static void settle_depths(double sound) {
        std::vector<FeaturePerId*> points;
        for (FeaturePerId& point : estimator.f_manager.feature)
            if (!(point.estimated_depth > 0)) points.push_back(&point);
        estimator.f_manager.triangulate(estimator.Ps, estimator.tic, estimator.ric);
        for (FeaturePerId* point : points) {
            double& depth = point->estimated_depth;
            if (!(std::abs(depth) < FAR_M))
                depth = INIT_DEPTH;
            else if (sound < 0)
                depth = sound;
        }
    }

    static Pose pose(int slot) { return {estimator.Rs[slot], estimator.Ps[slot]}; }

    // Return where K is in the window, or -1.
    int keyframe_slot() const {
        for (int slot = 0; slot <= NEWEST; ++slot)
            if (estimator.Headers[slot].stamp.toSec() == keyframe_s_) return slot;
        return -1;
    }

    viso::Estimate estimate_of(double t_s) {
        viso::Estimate estimate;
        const bool is_own = keyframe_s_ == 0;  // the first with a state is a keyframe
        if (is_own) keyframe_s_ = t_s;
        const int keyframe = keyframe_slot();
        if (keyframe < 0) {
            estimate.status = viso::Status::FAILED;
            return estimate;
        }
        const Pose K = pose(keyframe), B = pose(NEWEST);
        estimator.vector2double();
        const unsigned inliers = tell_features(K, B, estimate);
        estimate.status = inliers >= adapter::LOST_INLIERS ? viso::Status::TRACKING : viso::Status::LOST;
        adapter::tell_pose(K, B, estimate);
        estimate.velocity_world = adapter::numbers(estimator.Vs[NEWEST]);
        estimate.accel_bias = adapter::numbers(estimator.Bas[NEWEST]);
        estimate.gyro_bias = adapter::numbers(estimator.Bgs[NEWEST]);
        tell_covariance(keyframe, K, estimate);
        if (is_own || keyframe <= OLDEST_KEYFRAME) {
            keyframe_s_ = t_s;
            MIN_PARALLAX = 0;  // VINS-Mono decides with the next image whether to keep this one: it shall
            estimate.is_keyframe = 1;
        }
        return estimate;
    }

    // Call a function with each point that is estimated, and its index among them.
    template <class Use> static void for_points(const Use& use) {
        int index = -1;
        for (auto& point : estimator.f_manager.feature)
            if (point.feature_per_frame.size() >= 2 && point.start_frame < WINDOW_SIZE - 2) use(point, ++index);
    }

    unsigned tell_features(const Pose& K, const Pose& B, viso::Estimate& estimate) {
        const Pose body_T_camera(estimator.ric[0], estimator.tic[0]);
        const Eigen::Vector3d from = (K * body_T_camera).t, to = (B * body_T_camera).t;
        adapter::Inliers inliers(setup_.width, setup_.height);
        for_points([&](FeaturePerId& point, int index) {
            if (point.endFrame() != NEWEST || point.start_frame == NEWEST) return;
            const auto &first = point.feature_per_frame.front(), &last = point.feature_per_frame.back();
            const double* const blocks[] = {estimator.para_Pose[point.start_frame], estimator.para_Pose[NEWEST],
                                            estimator.para_Ex_Pose[0], estimator.para_Feature[index]};
            Eigen::Vector2d residual;
            ProjectionFactor(first.point, last.point).Evaluate(blocks, residual.data(), nullptr);
            const Pose camera = pose(point.start_frame) * body_T_camera;
            const Eigen::Vector3d place = camera.R * (first.point * point.estimated_depth) + camera.t;
            inliers.take(last.uv.x(), last.uv.y(), pixels(residual.norm(), setup_.fx), residual.squaredNorm(),
                         adapter::parallax_px(place, from, to, setup_.fx));
        });
        inliers.tell(estimate);
        estimate.lost = lost_;
        estimate.fresh = fresh_;
        return inliers.count();
    }

    // Tell the covariance from the information in the window: prior, IMU and points, of which the points are
    // eliminated, and K is held where nothing is seen of it, in its position and yaw.
    void tell_covariance(int keyframe, const Pose& K, viso::Estimate& estimate) const {
        if (keyframe == NEWEST) return adapter::tell_covariance(adapter::Matrix12::Zero(), estimate);
        H_.setZero(STATES, STATES);
        if (estimator.last_marginalization_info) {
            MarginalizationFactor prior(estimator.last_marginalization_info);
            add(prior, estimator.last_marginalization_parameter_blocks);
        }
        for (int slot = 1; slot <= NEWEST; ++slot) {
            if (estimator.pre_integrations[slot]->sum_dt > 10) continue;  // as VINS-Mono does
            IMUFactor imu(estimator.pre_integrations[slot]);
            add(imu, {estimator.para_Pose[slot - 1], estimator.para_SpeedBias[slot - 1], estimator.para_Pose[slot],
                      estimator.para_SpeedBias[slot]});
        }
        for_points([this](const FeaturePerId& point, int index) { add(point, index); });
        const int at_keyframe = STATE * keyframe, at_body = STATE * NEWEST;
        for (int axis = 0; axis < 3; ++axis) H_(at_keyframe + axis, at_keyframe + axis) += FIXED;
        const Eigen::Vector3d up = K.R.transpose().col(2);  // in K's body
        H_.block<3, 3>(at_keyframe + 3, at_keyframe + 3) += FIXED * up * up.transpose();
        H_.diagonal().array() += 1e-9;
        Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(STATES, 12);
        for (int i = 0; i < 6; ++i) {
            columns(at_keyframe + (i + 3) % 6, i) = 1;
            columns(at_body + (i + 3) % 6, 6 + i) = 1;
        }
        adapter::tell_covariance(columns.transpose() * H_.ldlt().solve(columns), estimate);
    }

    // Return where a block of VINS-Mono's parameters is among the states, or -1.
    static int place_of(const double* block) {
        for (int slot = 0; slot <= NEWEST; ++slot) {
            if (block == estimator.para_Pose[slot]) return STATE * slot;
            if (block == estimator.para_SpeedBias[slot]) return STATE * slot + 6;
        }
        return -1;
    }

    using Jacobian = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

    // Return what a factor says and how it depends on its blocks; of a pose the first six columns count.
    static std::pair<Eigen::VectorXd, std::vector<Jacobian>> evaluated(const ceres::CostFunction& factor,
                                                                        const std::vector<double*>& blocks) {
        Eigen::VectorXd residuals(factor.num_residuals());
        std::vector<Jacobian> jacobians;
        std::vector<double*> raw;
        for (const int size : factor.parameter_block_sizes()) jacobians.emplace_back(factor.num_residuals(), size);
        for (Jacobian& jacobian : jacobians) raw.push_back(jacobian.data());
        factor.Evaluate(blocks.data(), residuals.data(), raw.data());
        for (Jacobian& jacobian : jacobians)
            if (jacobian.cols() == SIZE_POSE) jacobian = jacobian.leftCols(6).eval();
        return {std::move(residuals), std::move(jacobians)};
    }

    void add(const ceres::CostFunction& factor, const std::vector<double*>& blocks) const {
        const auto jacobians = evaluated(factor, blocks).second;
        for (std::size_t a = 0; a < blocks.size(); ++a) {
            const int row = place_of(blocks[a]);
            if (row < 0) continue;
            for (std::size_t b = 0; b < blocks.size(); ++b) {
                const int column = place_of(blocks[b]);
                if (column < 0) continue;
                H_.block(row, column, jacobians[a].cols(), jacobians[b].cols()) +=
                    jacobians[a].transpose() * jacobians[b];
            }
        }
    }

    // Add what a point says of the poses that have seen it, its depth eliminated; weighted as VINS-Mono's loss does.
    void add(const FeaturePerId& point, int index) const {
        double own = 0;
        std::map<int, Eigen::Matrix<double, 6, 1>> with;  // by the place of a pose
        int slot = point.start_frame;
        for (std::size_t i = 1; i < point.feature_per_frame.size() && ++slot <= NEWEST; ++i) {
            const ProjectionFactor factor(point.feature_per_frame[0].point, point.feature_per_frame[i].point);
            const int places[] = {STATE * point.start_frame, STATE * slot};
            auto [residual, jacobians] =
                evaluated(factor, {estimator.para_Pose[point.start_frame], estimator.para_Pose[slot],
                                   estimator.para_Ex_Pose[0], estimator.para_Feature[index]});
            const double weight = 1 / (1 + residual.squaredNorm());
            own += weight * jacobians[3].squaredNorm();
            for (int a = 0; a < 2; ++a) {
                with.try_emplace(places[a], Eigen::Matrix<double, 6, 1>::Zero()).first->second +=
                    weight * jacobians[a].transpose() * jacobians[3];
                for (int b = 0; b < 2; ++b)
                    H_.block<6, 6>(places[a], places[b]) += weight * jacobians[a].transpose() * jacobians[b];
            }
        }
        if (!(own > 0)) return;
        for (const auto& [row, one] : with)
            for (const auto& [column, other] : with) H_.block<6, 6>(row, column) -= one * other.transpose() / own;
    }

    viso::Setup setup_ = {};
    std::vector<std::uint8_t> mask_;
    double least_parallax_ = 0;
    FeatureTracker tracker_;
    std::unique_ptr<viso::Start> start_;  // until there is a state
    std::deque<viso::Imu> imu_;           // not yet handed on
    viso::Imu last_sample_ = {};
    std::int64_t begin_ns_ = 0, last_imu_ns_ = 0;
    double keyframe_s_ = 0;  // K's stamp
    std::size_t tracked_ = 0;
    unsigned fresh_ = 0, lost_ = 0;
    viso::Estimate last_;
    mutable Eigen::MatrixXd H_;
};

}  // namespace

int main() {
    return viso::run([] { return std::make_unique<VinsMono>(); }, "vins_mono", viso::HAS_COVARIANCE, 1000);
}
