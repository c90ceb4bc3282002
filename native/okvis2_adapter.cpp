// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
//
// OKVIS2 as a program that viso runs. docs/engines.md tells which headers and libraries it wants; OKVIS2_ROOT is where
// OKVIS2's sources are, and small_voc.yml.gz is below it in resources/.
//
// OKVIS2 is driven image by image, without its threads for input and output. Its rotation errors are on the left, in
// the world.

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <ceres/crs_matrix.h>
#include <ceres/problem.h>
#include <glog/logging.h>
#include <okvis/Frontend.hpp>
#include <okvis/Parameters.hpp>
#include <okvis/ViSlamBackend.hpp>
#include <okvis/cameras/EquidistantDistortion.hpp>
#include <okvis/cameras/PinholeCamera.hpp>
#include <okvis/cameras/RadialTangentialDistortion.hpp>
#include <okvis/ceres/ImuError.hpp>
#include <opencv2/core.hpp>

#include "adapter.hpp"

namespace {

using adapter::Pose;
using okvis::StateId;
using okvis::kinematics::Transformation;

constexpr std::size_t FEWEST_KEYPOINTS = 15;  // to start from
constexpr std::size_t COVARIANCE_STATES = 14;
constexpr int POSE = 6, SPEED_AND_BIAS = 9, POINT = 3;  // degrees of freedom
constexpr double FIXED = 1e10;                          // information of what is held

// The graph that OKVIS2 optimises is private in its backend, and what is in it protected.
struct RealtimeGraph {
    using Member = okvis::ViGraphEstimator okvis::ViSlamBackend::*;
    friend Member member(RealtimeGraph);
};
struct FullGraph {
    using Member = okvis::ViGraphEstimator okvis::ViSlamBackend::*;
    friend Member member(FullGraph);
};
template <class Tag, typename Tag::Member pointer> struct Shown {
    friend typename Tag::Member member(Tag) { return pointer; }
};
template struct Shown<RealtimeGraph, &okvis::ViSlamBackend::realtimeGraph_>;
template struct Shown<FullGraph, &okvis::ViSlamBackend::fullGraph_>;

struct Graph : okvis::ViGraphEstimator {
    static auto& states(okvis::ViGraph& graph) { return graph.*(&Graph::states_); }
    static auto& landmarks(okvis::ViGraph& graph) { return graph.*(&Graph::landmarks_); }
    static auto& problem(okvis::ViGraph& graph) { return *(graph.*(&Graph::problem_)); }
};

Pose pose_of(const Eigen::Matrix4d& T) { return {T.topLeftCorner<3, 3>(), T.topRightCorner<3, 1>()}; }

Transformation transformation(const Pose& pose) { return {pose.t, Eigen::Quaterniond(pose.R)}; }

okvis::Time time_of(std::int64_t t_ns) {
    return {static_cast<std::uint32_t>(t_ns / 1'000'000'000), static_cast<std::uint32_t>(t_ns % 1'000'000'000)};
}

template <class Distortion>
void add_camera(okvis::cameras::NCameraSystem& system, const viso::Setup& setup, const Distortion& distortion,
                okvis::cameras::NCameraSystem::DistortionType type) {
    auto camera = std::make_shared<okvis::cameras::PinholeCamera<Distortion>>(
        static_cast<int>(setup.width), static_cast<int>(setup.height), setup.fx, setup.fy, setup.cx, setup.cy,
        distortion);
    camera->initialiseCameraAwarenessMaps();
    okvis::cameras::NCameraSystem::CameraType grey;
    grey.isColour = false;
    system.addCamera(std::make_shared<Transformation>(transformation(Pose(setup.body_T_camera))), camera, type, true,
                     grey);
}

okvis::ViParameters parameters_of(const viso::Setup& setup, viso::Options& options) {
    okvis::ViParameters all{};
    const auto& k = setup.distortion;
    if (setup.distortion_model == viso::Distortion::EQUIDISTANT)
        add_camera(all.nCameraSystem, setup, okvis::cameras::EquidistantDistortion(k[0], k[1], k[2], k[3]),
                   okvis::cameras::NCameraSystem::Equidistant);
    else if (k[4] == 0)
        add_camera(all.nCameraSystem, setup, okvis::cameras::RadialTangentialDistortion(k[0], k[1], k[2], k[3]),
                   okvis::cameras::NCameraSystem::RadialTangential);
    else
        throw std::invalid_argument("OKVIS2 has no third radial coefficient");

    all.camera.online_calibration.do_extrinsics = options.flag("estimate_extrinsics", false);
    all.camera.online_calibration.sigma_r = std::max(setup.body_T_camera_position_sigma, 1e-4);
    all.camera.online_calibration.sigma_alpha = std::max(setup.body_T_camera_rotation_sigma, 1e-4);

    all.imu.use = true;
    all.imu.a_max = std::min(setup.accel_limit, 1e3);
    all.imu.g_max = std::min(setup.gyro_limit, 1e2);
    all.imu.sigma_g_c = setup.gyro_noise;
    all.imu.sigma_a_c = setup.accel_noise;
    all.imu.sigma_gw_c = setup.gyro_walk;
    all.imu.sigma_aw_c = setup.accel_walk;
    all.imu.sigma_bg = options.number("gyro_bias_sigma", 0.01);
    all.imu.sigma_ba = options.number("accel_bias_sigma", 0.1);
    all.imu.g = setup.gravity;
    all.imu.g0 = all.imu.a0 = Eigen::Vector3d::Zero();

    const int threads = static_cast<int>(std::max(setup.threads, 1u));
    all.frontend.detection_threshold = options.number("detection_threshold", 38);
    all.frontend.absolute_threshold = options.number("absolute_threshold", 150);
    all.frontend.matching_threshold = options.number("matching_threshold", 60);
    all.frontend.octaves = static_cast<int>(options.number("octaves", 0));
    all.frontend.max_num_keypoints = static_cast<int>(std::min(4 * setup.max_features, 700u));
    all.frontend.keyframe_overlap = options.number("keyframe_overlap", 0.6);
    all.frontend.num_matching_threads = threads;

    all.estimator.num_keyframes = static_cast<int>(options.number("keyframes", 5));
    all.estimator.num_imu_frames = static_cast<int>(options.number("imu_frames", 3));
    all.estimator.realtime_max_iterations = static_cast<int>(options.number("iterations", 10));
    all.estimator.realtime_num_threads = threads;
    return all;
}

class Okvis2 final : public viso::Engine {
public:
    void set_up(const viso::Setup& setup, viso::Options& options, const std::vector<std::uint8_t>&) override {
        const char* root = std::getenv("OKVIS2_ROOT");
        const std::string vocabulary = options.text("vocabulary", std::string(root ? root : ".") + "/resources");
        setup_ = setup;
        parameters_ = parameters_of(setup, options);
        options.expect_no_others();
        cv::setNumThreads(static_cast<int>(setup.threads));
        no_image_ = cv::Mat::zeros(static_cast<int>(setup.height), static_cast<int>(setup.width), CV_8UC1);
        front_end_ = std::make_unique<okvis::Frontend>(1, vocabulary);
        const auto& wanted = parameters_.frontend;
        if (wanted.octaves != 0) front_end_->setBriskDetectionOctaves(static_cast<std::size_t>(wanted.octaves));
        front_end_->setBriskDetectionThreshold(wanted.detection_threshold);
        front_end_->setBriskDetectionAbsoluteThreshold(wanted.absolute_threshold);
        front_end_->setBriskMatchingThreshold(wanted.matching_threshold);
        front_end_->setBriskDetectionMaximumKeypoints(static_cast<std::size_t>(wanted.max_num_keypoints));
        front_end_->setKeyframeInsertionOverlapThreshold(static_cast<float>(wanted.keyframe_overlap));
    }

    void reset(const viso::Start* start) override {
        front_end_->clear();
        backend_ = std::make_unique<okvis::ViSlamBackend>();
        backend_->addImu(parameters_.imu);
        backend_->addCamera(parameters_.camera);
        backend_->setDetectorUniformityRadius(parameters_.frontend.detection_threshold);
        imu_.clear();
        seen_.clear();
        start_ = start ? std::make_unique<viso::Start>(*start) : nullptr;
        keyframe_ = StateId();
        last_ = viso::Estimate();
    }

    void add_imu(const viso::Imu& sample) override {
        okvis::ImuMeasurement measurement;
        measurement.timeStamp = time_of(sample.t_ns);
        measurement.measurement.accelerometers = adapter::vector(sample.accel);
        measurement.measurement.gyroscopes = adapter::vector(sample.gyro);
        imu_.push_back(measurement);
    }

    viso::Estimate add_image(const viso::Image& image) override {
        const okvis::Time stamp = time_of(image.t_ns);
        const bool is_first = backend_->numFrames() == 0;
        if (imu_.empty() || imu_.back().timeStamp < stamp || imu_.front().timeStamp > stamp) return without_image();

        auto frame = std::make_shared<okvis::MultiFrame>(parameters_.nCameraSystem, stamp, 0);
        frame->setImage(0, cv::Mat(static_cast<int>(image.height), static_cast<int>(image.width), CV_8UC1,
                                   const_cast<std::uint8_t*>(image.pixels)).clone());
        front_end_->detectAndDescribe(0, frame, predicted(stamp, is_first) * *parameters_.nCameraSystem.T_SC(0),
                                      nullptr);
        frame->setImage(0, no_image_);  // OKVIS2 keeps it for ever, for its size
        if (is_first && frame->numKeypoints() < FEWEST_KEYPOINTS) return viso::Estimate();
        if (!backend_->addStates(frame, imu_, false)) return without_image();
        if (is_first && start_) impose(*start_);
        bool is_keyframe = false;
        const bool associated =
            front_end_->dataAssociationAndInitialization(*backend_, parameters_, frame, &is_keyframe);
        if (!associated && !front_end_->isInitialized()) {
            const std::unique_ptr<viso::Start> start = std::move(start_);
            reset(start.get());
            return viso::Estimate();
        }
        const StateId id(frame->id());
        const bool is_initialised = !is_first && front_end_->isInitialized();
        const bool is_own = is_initialised && !keyframe_.isInitialised();  // the first with a state is a keyframe
        backend_->setKeyframe(id, is_keyframe || is_own);
        std::vector<StateId> updated;
        backend_->optimiseRealtimeGraph(parameters_.estimator.realtime_max_iterations, updated,
                                        parameters_.estimator.realtime_num_threads, false, false,
                                        start_ || front_end_->isInitialized());
        viso::Estimate estimate;
        if (is_initialised) {
            estimate = estimate_of(id, is_own ? id : keyframe_, is_keyframe || is_own);
            // Before there is a state nothing may refer to this image.
            if (estimate.status != viso::Status::INITIALISING && (is_keyframe || is_own)) keyframe_ = id;
        }
        std::set<StateId> affected;
        backend_->applyStrategy(static_cast<std::size_t>(parameters_.estimator.num_keyframes), 0,
                                static_cast<std::size_t>(parameters_.estimator.num_imu_frames), affected, true);
        forget_imu_before(stamp);
        return last_ = estimate;
    }

private:
    // Return what there is to say where the image could not be used.
    viso::Estimate without_image() {
        if (last_.is_keyframe) last_.keyframe_T_body = viso::IDENTITY;
        last_.is_keyframe = 0;
        last_.covariance_kind = viso::CovarianceKind::NONE;
        last_.inliers = 0;
        if (last_.status != viso::Status::INITIALISING) last_.status = viso::Status::LOST;
        return last_;
    }

    Transformation predicted(const okvis::Time& stamp, bool is_first) {
        Transformation T_WS;
        if (is_first && start_) return transformation(Pose(start_->world_T_body));
        if (is_first) {
            okvis::ceres::ImuError::initPose(imu_, T_WS);
            return T_WS;
        }
        const StateId id = backend_->currentStateId();
        T_WS = backend_->pose(id);
        okvis::SpeedAndBias speed_and_bias = backend_->speedAndBias(id);
        okvis::ceres::ImuError::propagation(imu_, parameters_.imu, T_WS, speed_and_bias, backend_->timestamp(id),
                                            stamp);
        return T_WS;
    }

    // Put a state in the place of the one that OKVIS2 has taken from the accelerometer, and of its priors.
    void impose(const viso::Start& start) {
        const Transformation T_WS = transformation(Pose(start.world_T_body));
        okvis::SpeedAndBias speed_and_bias;
        speed_and_bias << adapter::vector(start.velocity_world), adapter::vector(start.gyro_bias),
            adapter::vector(start.accel_bias);
        const auto variances = adapter::variances(start);
        const Eigen::Matrix3d attitude =
            (T_WS.C() * variances.head<3>().asDiagonal() * T_WS.C().transpose()).inverse();
        Eigen::Matrix<double, 6, 6> pose_information = Eigen::Matrix<double, 6, 6>::Zero();
        pose_information.topLeftCorner<3, 3>().diagonal().setConstant(1e8);  // where it is and north are given
        pose_information.bottomRightCorner<3, 3>() = attitude;
        pose_information(5, 5) += 1e4;
        Eigen::Matrix<double, 9, 1> weights;
        weights << variances.segment<3>(6).cwiseInverse(), variances.segment<3>(9).cwiseInverse(),
            variances.segment<3>(12).cwiseInverse();
        const Eigen::Matrix<double, 9, 9> speed_information = weights.asDiagonal();
        for (okvis::ViGraph* graph : {&graph_of(member(RealtimeGraph())), &graph_of(member(FullGraph()))}) {
            auto& problem = Graph::problem(*graph);
            auto& state = Graph::states(*graph).begin()->second;
            state.pose->setEstimate(T_WS);
            state.speedAndBias->setEstimate(speed_and_bias);
            problem.RemoveResidualBlock(state.posePrior.residualBlockId);
            problem.RemoveResidualBlock(state.speedAndBiasPrior.residualBlockId);
            state.posePrior.errorTerm = std::make_shared<okvis::ceres::PoseError>(T_WS, pose_information);
            state.speedAndBiasPrior.errorTerm =
                std::make_shared<okvis::ceres::SpeedAndBiasError>(speed_and_bias, speed_information);
            state.posePrior.residualBlockId =
                problem.AddResidualBlock(state.posePrior.errorTerm.get(), nullptr, state.pose->parameters());
            state.speedAndBiasPrior.residualBlockId = problem.AddResidualBlock(
                state.speedAndBiasPrior.errorTerm.get(), nullptr, state.speedAndBias->parameters());
        }
    }

    viso::Estimate estimate_of(StateId id, StateId keyframe, bool is_keyframe) {
        viso::Estimate estimate;
        const Pose K = pose_of(backend_->pose(keyframe).T()), B = pose_of(backend_->pose(id).T());
        const unsigned inliers = tell_features(id, K, B, estimate);
        const bool tracks = inliers >= adapter::LOST_INLIERS && backend_->trackingQuality(id) >= 0.01;
        if (!tracks && !keyframe_.isInitialised()) return viso::Estimate();  // not a state to begin with
        estimate.status = tracks ? viso::Status::TRACKING : viso::Status::LOST;
        estimate.is_keyframe = is_keyframe;
        adapter::tell_pose(K, B, estimate);
        const okvis::SpeedAndBias& speed_and_bias = backend_->speedAndBias(id);
        estimate.velocity_world = adapter::numbers(speed_and_bias.head<3>());
        estimate.gyro_bias = adapter::numbers(speed_and_bias.segment<3>(3));
        estimate.accel_bias = adapter::numbers(speed_and_bias.tail<3>());
        tell_covariance(id, keyframe, K, B, estimate);
        return estimate;
    }

    // Tell of the points seen here and in another image; those seen here only measure nothing.
    unsigned tell_features(StateId id, const Pose& K, const Pose& B, viso::Estimate& estimate) {
        auto& graph = graph_of(member(RealtimeGraph()));
        auto& state = Graph::states(graph).at(id);
        const Pose body_T_camera = pose_of(state.extrinsics.at(0)->estimate().T());
        const Eigen::Vector3d from = (K * body_T_camera).t, to = (B * body_T_camera).t;
        adapter::Inliers inliers(setup_.width, setup_.height);
        std::set<std::uint64_t> seen;
        for (const auto& [where, observation] : state.observations) {
            auto& landmark = Graph::landmarks(graph).at(observation.landmarkId);
            if (landmark.observations.size() < 2) continue;
            const double* blocks[] = {state.pose->parameters(), landmark.hPoint->parameters(),
                                      state.extrinsics.at(0)->parameters()};
            Eigen::Vector2d residual;
            const auto& error = *observation.errorTerm;
            if (!error.Evaluate(blocks, residual.data(), nullptr)) continue;
            const Eigen::Vector4d point = landmark.hPoint->estimate();
            const Eigen::Vector3d place = point.head<3>() / std::max(point[3], 1e-9);
            seen.insert(observation.landmarkId.value());
            inliers.take(error.measurement().x(), error.measurement().y(),
                         residual.norm() / std::sqrt(error.information()(0, 0)), residual.squaredNorm(),
                         adapter::parallax_px(place, from, to, setup_.fx));
        }
        inliers.tell(estimate);
        for (const std::uint64_t point : seen_) estimate.lost += seen.count(point) == 0;
        seen_ = std::move(seen);
        return inliers.count();
    }

    // Tell the covariance from the information of the newest states: the points are eliminated, and K is held where
    // nothing is seen of it, in its position and yaw.
    void tell_covariance(StateId id, StateId keyframe, const Pose& K, const Pose& B, viso::Estimate& estimate) {
        if (id == keyframe) return adapter::tell_covariance(adapter::Matrix12::Zero(), estimate);
        auto& graph = graph_of(member(RealtimeGraph()));
        auto& problem = Graph::problem(graph);
        ceres::Problem::EvaluateOptions of;
        std::set<ceres::ResidualBlockId> residuals;
        std::set<std::uint64_t> points;
        const auto add = [&](double* block) {
            of.parameter_blocks.push_back(block);
            std::vector<ceres::ResidualBlockId> touching;
            problem.GetResidualBlocksForParameterBlock(block, &touching);
            residuals.insert(touching.begin(), touching.end());
        };
        int size = 0, at_body = -1, at_keyframe = -1;
        auto& states = Graph::states(graph);
        std::size_t left = COVARIANCE_STATES;
        for (auto state = states.rbegin(); state != states.rend() && left > 0; ++state, --left) {
            double* const pose = state->second.pose->parameters();
            if (problem.IsParameterBlockConstant(pose)) break;
            if (state->first == id) at_body = size;
            if (state->first == keyframe) at_keyframe = size;
            add(pose);
            size += POSE;
            double* const speed_and_bias = state->second.speedAndBias->parameters();
            if (problem.HasParameterBlock(speed_and_bias) && !problem.IsParameterBlockConstant(speed_and_bias)) {
                add(speed_and_bias);
                size += SPEED_AND_BIAS;
            }
            for (const auto& [where, observation] : state->second.observations)
                points.insert(observation.landmarkId.value());
        }
        if (at_body < 0 || at_keyframe < 0) return;  // K is constant already
        for (const std::uint64_t point : points) {
            double* const block =
                Graph::landmarks(graph).at(okvis::LandmarkId(point)).hPoint->parameters();
            if (!problem.IsParameterBlockConstant(block)) add(block);
        }
        of.residual_blocks.assign(residuals.begin(), residuals.end());
        of.num_threads = 1;
        ceres::CRSMatrix J;
        if (!problem.Evaluate(of, nullptr, nullptr, nullptr, &J)) return;
        Eigen::MatrixXd H = information(J, size);
        for (const int held : {at_keyframe, at_keyframe + 1, at_keyframe + 2, at_keyframe + 5}) H(held, held) += FIXED;
        H.diagonal().array() += 1e-9;
        Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(size, 2 * POSE);
        const int places[] = {at_keyframe, at_body};
        for (int pose = 0; pose < 2; ++pose)
            for (int i = 0; i < POSE; ++i) columns(places[pose] + (i + 3) % POSE, pose * POSE + i) = 1;
        const adapter::Matrix12 left_errors = columns.transpose() * H.ldlt().solve(columns);
        // Rotation errors on the right are those on the left, turned into the body.
        adapter::Matrix12 turn = adapter::Matrix12::Identity();
        turn.block<3, 3>(0, 0) = K.R.transpose();
        turn.block<3, 3>(6, 6) = B.R.transpose();
        adapter::tell_covariance(turn * left_errors * turn.transpose(), estimate);
    }

    // Return J^T J of the first columns, all others, in threes, eliminated.
    static Eigen::MatrixXd information(const ceres::CRSMatrix& J, int size) {
        struct Point {
            Eigen::Matrix3d own = Eigen::Matrix3d::Zero();
            std::map<int, Eigen::RowVector3d> with;  // by the column of a state
        };
        Eigen::MatrixXd H = Eigen::MatrixXd::Zero(size, size);
        std::vector<Point> points(static_cast<std::size_t>((J.num_cols - size) / POINT));
        for (int row = 0; row < J.num_rows; ++row) {
            for (int a = J.rows[row]; a < J.rows[row + 1]; ++a) {
                const int i = J.cols[a];
                for (int b = J.rows[row]; b < J.rows[row + 1]; ++b) {
                    const int j = J.cols[b];
                    const double product = J.values[a] * J.values[b];
                    if (product == 0) continue;
                    if (i < size && j < size) {
                        H(i, j) += product;
                    } else if (j >= size) {
                        Point& point = points[static_cast<std::size_t>((j - size) / POINT)];
                        if (i >= size)
                            point.own((i - size) % POINT, (j - size) % POINT) += product;
                        else
                            point.with.try_emplace(i, Eigen::RowVector3d::Zero()).first->second[(j - size) % POINT] +=
                                product;
                    }
                }
            }
        }
        for (Point& point : points) {
            // A point far away says nothing along its ray.
            const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solved(point.own);
            const Eigen::Vector3d values = solved.eigenvalues();
            const Eigen::Vector3d inverses =
                (values.array() > 1e-9 * values[2]).select(values.array().inverse(), 0.0).matrix();
            const Eigen::Matrix3d inverse =
                solved.eigenvectors() * inverses.asDiagonal() * solved.eigenvectors().transpose();
            for (const auto& [i, one] : point.with) {
                const Eigen::RowVector3d weighted = one * inverse;
                for (const auto& [j, other] : point.with) H(i, j) -= weighted.dot(other);
            }
        }
        return H;
    }

    // All samples from the one before the stamp on are needed again.
    void forget_imu_before(const okvis::Time& stamp) {
        while (imu_.size() > 1 && imu_[1].timeStamp < stamp) imu_.pop_front();
    }

    okvis::ViGraph& graph_of(RealtimeGraph::Member which) { return (*backend_).*which; }

    viso::Setup setup_ = {};
    okvis::ViParameters parameters_{};
    cv::Mat no_image_;
    std::unique_ptr<okvis::Frontend> front_end_;
    std::unique_ptr<okvis::ViSlamBackend> backend_;
    okvis::ImuMeasurementDeque imu_;
    std::unique_ptr<viso::Start> start_;
    StateId keyframe_;
    std::set<std::uint64_t> seen_;  // points in the image before
    viso::Estimate last_;
};

}  // namespace

int main() {
    FLAGS_logtostderr = true;
    FLAGS_minloglevel = google::GLOG_ERROR;
    return viso::run([] { return std::make_unique<Okvis2>(); }, "okvis2",
                     viso::STARTS_AT_REST | viso::HAS_COVARIANCE, 1000);
}
