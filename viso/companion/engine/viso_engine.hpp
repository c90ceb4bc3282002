// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
//
// Makes a program of an engine for visual-inertial odometry that viso runs: `viso vio SOURCE --engine ./program`.
//
// Derive a class from viso::Engine, and
//     int main() { return viso::run([] { return std::make_unique<Mine>(); }, "mine", viso::STARTS_AT_REST); }
// One file, C++17, Linux, only the standard library. docs/engines.md has the protocol, an example and the rules. The
// structs here are its messages, byte for byte.
//
// Stamps are nanoseconds of the IMU's clock. The world is ENU with gravity (0, 0, -g), the body FLU with its origin in
// the IMU; a camera's x points right, y down. A_T_B maps from B to A: [4, 4], row by row. Units are m, s, rad.
//
// Standard output belongs to the protocol. Text that is printed there goes to standard error, and so into viso's log.

#ifndef VISO_ENGINE_HPP
#define VISO_ENGINE_HPP

#include <array>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <unistd.h>

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "the protocol is little-endian"
#endif

namespace viso {

constexpr std::uint32_t VERSION = 1;

using Vector3 = std::array<double, 3>;
using Matrix4 = std::array<double, 16>;  // row by row

constexpr Matrix4 IDENTITY = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

// Capabilities, to be combined.
constexpr std::uint32_t STARTS_AT_REST = 1;     // finds its state while the body stands still; else it needs motion
constexpr std::uint32_t TAKES_HEIGHT = 2;       // uses add_height
constexpr std::uint32_t HAS_COVARIANCE = 4;     // estimates have one, RELATIVE or JOINT
constexpr std::uint32_t UPDATES_KEYFRAMES = 8;  // update_keyframe is called

enum class Status : std::uint32_t {
    INITIALISING = 0,  // there is no state
    TRACKING = 1,      // the image was used
    LOST = 2,          // the image could not be used: the IMU alone carries the state on
    FAILED = 3         // nothing holds before a reset
};

enum class CovarianceKind : std::uint32_t {
    NONE = 0,
    RELATIVE = 1,  // the first 36: of keyframe_T_body, right perturbation, (rx, ry, rz, tx, ty, tz) in the body
    JOINT = 2      // all 144: of K and body together, each (rotation, right perturbation; position, in the world)
};

enum class Distortion : std::uint32_t { NONE = 0, RADTAN = 1, EQUIDISTANT = 2 };

// The program's first message.
struct Hello {
    double imu_rate_hz = 0;  // least samples per second; viso warns below that; 0 for any
    std::uint32_t version = VERSION;
    std::uint32_t capabilities = 0;
    std::uint32_t image_width_px = 0;  // width of the widest picture that it takes; 0 for any
    std::uint32_t zero = 0;
    char name[64] = {};
};

// The camera, the IMU and what else does not change.
struct Setup {
    double fx, fy, cx, cy;                 // px; the middle of the first pixel is (0, 0)
    std::array<double, 8> distortion;      // k1 k2 p1 p2 k3 (radtan), k1 k2 k3 k4 (equidistant), then zeros
    Matrix4 body_T_camera;
    double body_T_camera_rotation_sigma;   // 0 for exact
    double body_T_camera_position_sigma;   // 0 for exact
    double time_offset_s;                  // added already: the stamps of images are of the IMU's clock
    double time_offset_sigma_s;            // 0 for exact
    double line_time_s;                    // time from a line of the picture to the next; 0 for a global shutter
    double gyro_noise, accel_noise;        // densities, rad/s/sqrt(Hz), m/s^2/sqrt(Hz)
    double gyro_walk, accel_walk;          // densities, rad/s^2/sqrt(Hz), m/s^3/sqrt(Hz)
    double imu_rate_hz;                    // 0 if not known; a deviation per sample is density * sqrt(rate)
    double gyro_limit, accel_limit;        // where they saturate; infinite if not known
    double gravity;                        // m/s^2
    std::uint32_t width, height;           // px
    Distortion distortion_model;
    std::uint32_t max_features, threads, seed;
};

struct Imu {
    std::int64_t t_ns;
    Vector3 accel;  // specific force, m/s^2
    Vector3 gyro;   // rad/s
};

struct Height {
    std::int64_t t_ns;
    double height_m, sigma_m;
};

// A state to start from; it holds at the next image.
struct Start {
    Matrix4 world_T_body;
    Vector3 velocity_world, accel_bias, gyro_bias;
    // Attitude (right perturbation), position and velocity (world), gyro bias, accelerometer bias.
    std::array<double, 225> covariance;
    std::uint32_t has_state, zero;
};

// A grey picture, row by row without gaps; the pixels are there until add_image returns, and not to be written to.
struct Image {
    std::int64_t t_ns;
    std::uint64_t id;  // 1 for the first image, then one more each
    std::uint32_t width, height, in_shared_memory, zero;
    const std::uint8_t* pixels;
};

struct Estimate {
    std::int64_t t_ns = 0;          // run() sets it
    std::uint64_t image_id = 0;     // run() sets it
    std::uint64_t keyframe_id = 0;  // K: run() sets it to the last image before this that was a keyframe, or to this
    Matrix4 world_T_body = IDENTITY;
    Matrix4 keyframe_T_body = IDENTITY;  // the body in K's body; identity for the first image that has a state
    Vector3 velocity_world = {}, accel_bias = {}, gyro_bias = {};
    double mean_parallax_px = 0;  // after removing rotation
    double mre_px = 0;            // mean reprojection error, over the inliers
    double coverage = 0;          // share of the picture that has inliers, 0 to 1
    double innovation_ratio = 1;  // mean normalised residual squared per degree of freedom, over the inliers
    std::array<double, 144> covariance = {};
    Status status = Status::INITIALISING;
    std::uint32_t is_keyframe = 0;  // 1: this image is the keyframe of those after it; so is the first with a state
    CovarianceKind covariance_kind = CovarianceKind::NONE;
    std::uint32_t tracked = 0, lost = 0, fresh = 0, inliers = 0;
    std::uint32_t zero = 0;
};

namespace detail {

struct Header {
    char magic[4];
    std::uint32_t kind, length;
};
struct SharedMemory {
    std::uint64_t size;
    std::uint32_t descriptor, zero;
};
struct Ready {
    std::uint32_t shared_memory, zero;
};
struct KeyframeUpdate {
    std::uint64_t keyframe_id;
    Matrix4 world_T_keyframe;
    std::uint32_t is_loop_closure, zero;
};
constexpr std::size_t IMAGE_BYTES = 32;

static_assert(sizeof(Header) == 12 && sizeof(Hello) == 88 && sizeof(Setup) == 352 && sizeof(Imu) == 56, "layout");
static_assert(sizeof(Height) == 24 && sizeof(Start) == 2008 && offsetof(Image, pixels) == IMAGE_BYTES, "layout");
static_assert(sizeof(Estimate) == 1568 && sizeof(KeyframeUpdate) == 144 && sizeof(SharedMemory) == 16, "layout");

enum Kind : std::uint32_t {
    SETUP = 1, OPTIONS, SHARED_MEMORY, RESET, IMU, HEIGHT, IMAGE,
    HELLO = 101, READY, ESTIMATE, KEYFRAME_UPDATE, LOG, FAILURE
};

// The two ends of the connection.
class Pipe {
public:
    void claim_standard_output() {
        out_ = ::dup(1);
        ::dup2(2, 1);  // libraries print
    }

    // Returns false at the end of the input.
    bool read(void* to, std::size_t size) {
        auto* at = static_cast<char*>(to);
        while (size > 0) {
            const ssize_t count = ::read(0, at, size);
            if (count < 0 && errno == EINTR) continue;
            if (count <= 0) return false;
            at += count;
            size -= static_cast<std::size_t>(count);
        }
        return true;
    }

    // Any thread.
    void send(Kind kind, const void* body, std::size_t size, const void* tail = nullptr, std::size_t tail_size = 0) {
        const Header header = {{'V', 'I', 'S', 'E'}, kind, static_cast<std::uint32_t>(size + tail_size)};
        const std::lock_guard<std::mutex> lock(mutex_);
        write(&header, sizeof header);
        write(body, size);
        write(tail, tail_size);
    }

    void send_text(Kind kind, std::uint32_t level, const std::string& text) {
        send(kind, &level, kind == LOG ? sizeof level : 0, text.data(), text.size() < 1000 ? text.size() : 1000);
    }

private:
    void write(const void* from, std::size_t size) {
        auto* at = static_cast<const char*>(from);
        while (size > 0) {
            const ssize_t count = ::write(out_, at, size);
            if (count < 0 && errno == EINTR) continue;
            if (count <= 0) std::_Exit(0);  // viso has gone
            at += count;
            size -= static_cast<std::size_t>(count);
        }
    }

    int out_ = -1;
    std::mutex mutex_;
};

inline Pipe& connection() {
    static Pipe pipe;
    return pipe;
}

}  // namespace detail

// The configuration's table vio.native: names and values.
class Options {
public:
    explicit Options(const std::string& lines = {}) {
        std::istringstream in(lines);
        for (std::string line; std::getline(in, line);) {
            const auto at = line.find('=');
            values_[line.substr(0, at)] = line.substr(at + 1);
        }
    }

    // Return the value, or the default if there is none. Throws std::invalid_argument if the value has another type.
    std::string text(const std::string& name, const std::string& standard) {
        const auto at = values_.find(name);
        asked_[name];
        return at == values_.end() ? standard : at->second;
    }
    double number(const std::string& name, double standard) {
        const std::string value = text(name, "");
        if (value.empty()) return standard;
        char* end = nullptr;
        const double number = std::strtod(value.c_str(), &end);
        if (*end != '\0') throw std::invalid_argument("vio.native." + name + ": " + value + " is not a number");
        return number;
    }
    bool flag(const std::string& name, bool standard) {
        const std::string value = text(name, standard ? "true" : "false");
        if (value != "true" && value != "false") throw std::invalid_argument("vio.native." + name + ": not true or false");
        return value == "true";
    }
    // Throws std::invalid_argument if there is an option that was never read.
    void expect_no_others() const {
        for (const auto& [name, value] : values_)
            if (!asked_.count(name)) throw std::invalid_argument("vio.native." + name + ": unknown");
    }

private:
    std::map<std::string, std::string> values_, asked_;
};

// Write a line to viso's log: level 10 debug, 20 info, 30 warning, 40 error. Any thread.
inline void log(std::uint32_t level, const std::string& text) {
    detail::connection().send_text(detail::LOG, level, text);
}

// Send a better pose of a keyframe, from within add_image.
inline void update_keyframe(std::uint64_t keyframe_id, const Matrix4& world_T_keyframe, bool is_loop_closure) {
    const detail::KeyframeUpdate update = {keyframe_id, world_T_keyframe, is_loop_closure, 0};
    detail::connection().send(detail::KEYFRAME_UPDATE, &update, sizeof update);
}

// An engine. All calls come from one thread. An exception ends the program, and viso shows its text.
class Engine {
public:
    virtual ~Engine() = default;

    // Called once, first. An exception refuses.
    // mask: empty, or width * height bytes, 0 where the picture must not be used.
    virtual void set_up(const Setup& setup, Options& options, const std::vector<std::uint8_t>& mask) = 0;
    // Forget everything. Start from a state that holds at the next image, or (nullptr) find one.
    virtual void reset(const Start* start) = 0;
    // Stamps increase from one reset to the next. Samples up to an image come before it, and one beyond it.
    virtual void add_imu(const Imu& sample) = 0;
    virtual void add_height(const Height&) {}
    // Return when the result is there.
    virtual Estimate add_image(const Image& image) = 0;
};

namespace detail {

// Speaks the protocol for an engine.
class Session {
public:
    Session(Engine& engine, Pipe& pipe) : engine_(engine), pipe_(pipe) {}
    ~Session() {
        if (shared_ != nullptr) ::munmap(shared_, shared_size_);
    }
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    // Return at the end of the input.
    void serve() {
        Header header;
        while (pipe_.read(&header, sizeof header)) {
            if (std::memcmp(header.magic, "VISE", 4) != 0) throw std::runtime_error("no message");
            body_.resize(header.length);
            if (!pipe_.read(body_.data(), body_.size())) return;
            take(header.kind);
        }
    }

private:
    template <class T> T fixed(std::size_t size = sizeof(T)) const {
        if (body_.size() < size) throw std::runtime_error("message too short");
        T value{};
        std::memcpy(static_cast<void*>(&value), body_.data(), size);
        return value;
    }

    void take(std::uint32_t kind) {
        if (kind == SETUP) {
            setup_ = fixed<Setup>();
            mask_.assign(body_.begin() + sizeof(Setup), body_.end());
        } else if (kind == OPTIONS) {
            options_ = Options(std::string(body_.begin(), body_.end()));
        } else if (kind == SHARED_MEMORY) {
            map(fixed<SharedMemory>());
        } else if (kind == RESET) {
            reset(fixed<Start>());
        } else if (kind == IMU) {
            for (std::size_t at = 0; at + sizeof(Imu) <= body_.size(); at += sizeof(Imu)) {
                Imu sample;
                std::memcpy(&sample, body_.data() + at, sizeof sample);
                engine_.add_imu(sample);
            }
        } else if (kind == HEIGHT) {
            engine_.add_height(fixed<Height>());
        } else if (kind == IMAGE) {
            answer(fixed<Image>(IMAGE_BYTES));
        }  // others are for later versions
    }

    void map(const SharedMemory& memory) {
        struct stat status;
        const int file = static_cast<int>(memory.descriptor);
        if (::fstat(file, &status) != 0 || static_cast<std::uint64_t>(status.st_size) != memory.size) return;
        void* at = ::mmap(nullptr, memory.size, PROT_READ, MAP_SHARED, file, 0);
        if (at == MAP_FAILED) return;
        shared_ = at;
        shared_size_ = memory.size;
    }

    void reset(const Start& start) {
        if (!is_ready_) engine_.set_up(setup_, options_, mask_);
        engine_.reset(start.has_state ? &start : nullptr);
        keyframe_.reset();
        if (is_ready_) return;
        is_ready_ = true;
        const Ready ready = {shared_ != nullptr, 0};
        pipe_.send(READY, &ready, sizeof ready);
    }

    void answer(Image image) {
        const std::size_t size = std::size_t{image.width} * image.height;
        image.pixels = image.in_shared_memory ? static_cast<const std::uint8_t*>(shared_) : body_.data() + IMAGE_BYTES;
        if (!is_ready_ || size > (image.in_shared_memory ? shared_size_ : body_.size() - IMAGE_BYTES))
            throw std::runtime_error("image without its pixels");
        Estimate estimate = engine_.add_image(image);
        estimate.t_ns = image.t_ns;
        estimate.image_id = image.id;
        if (estimate.status == Status::TRACKING || estimate.status == Status::LOST) {
            if (!keyframe_) estimate.is_keyframe = 1;
            estimate.keyframe_id = keyframe_.value_or(image.id);
            if (estimate.is_keyframe) keyframe_ = image.id;
        }
        pipe_.send(ESTIMATE, &estimate, sizeof estimate);
    }

    Engine& engine_;
    Pipe& pipe_;
    Setup setup_ = {};
    Options options_;
    std::vector<std::uint8_t> body_, mask_;
    void* shared_ = nullptr;
    std::size_t shared_size_ = 0;
    bool is_ready_ = false;
    std::optional<std::uint64_t> keyframe_;
};

}  // namespace detail

// What an engine's program is: `int main() { return viso::run(make, "name", capabilities, width, rate); }`.
// Returns when viso has closed the connection, or with 1 after an exception, whose text viso tells.
inline int run(const std::function<std::unique_ptr<Engine>()>& make, const std::string& name,
               std::uint32_t capabilities, std::uint32_t image_width_px = 0, double imu_rate_hz = 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // not to be left alone in an endless loop
    std::signal(SIGPIPE, SIG_IGN);
    detail::Pipe& pipe = detail::connection();
    pipe.claim_standard_output();
    Hello hello;
    hello.imu_rate_hz = imu_rate_hz;
    hello.capabilities = capabilities;
    hello.image_width_px = image_width_px;
    name.copy(hello.name, sizeof hello.name - 1);
    pipe.send(detail::HELLO, &hello, sizeof hello);
    try {
        const std::unique_ptr<Engine> engine = make();
        detail::Session(*engine, pipe).serve();
        return 0;
    } catch (const std::exception& error) {
        pipe.send_text(detail::FAILURE, 0, error.what());
    } catch (...) {
        pipe.send_text(detail::FAILURE, 0, "exception of unknown kind");
    }
    return 1;
}

}  // namespace viso

#endif
