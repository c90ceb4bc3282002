// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
//
// What the adapters for engines with Eigen have in common: conversions, and what they tell of features and covariance.

#ifndef VISO_NATIVE_ADAPTER_HPP
#define VISO_NATIVE_ADAPTER_HPP

#include <algorithm>
#include <bitset>
#include <cmath>

#include <Eigen/Dense>

#include "viso_engine.hpp"

namespace adapter {

using RowMajor4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
using Matrix12 = Eigen::Matrix<double, 12, 12>;

constexpr double MAX_CHI2 = 9.21;      // 99 % of residuals with two degrees of freedom
constexpr unsigned LOST_INLIERS = 8;   // fewer tell nothing
constexpr double SMALLEST_SIGMA = 1e-4;  // rad and m, of an image relative to itself

struct Pose {
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    Eigen::Vector3d t = Eigen::Vector3d::Zero();

    Pose() = default;
    Pose(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) : R(rotation), t(translation) {}
    explicit Pose(const viso::Matrix4& rows) {
        const Eigen::Map<const RowMajor4> matrix(rows.data());
        R = Eigen::Quaterniond(Eigen::Matrix3d(matrix.topLeftCorner<3, 3>())).normalized().toRotationMatrix();
        t = matrix.topRightCorner<3, 1>();
    }
    Pose inverse() const { return {R.transpose(), -(R.transpose() * t)}; }
    Pose operator*(const Pose& other) const { return {R * other.R, R * other.t + t}; }
    viso::Matrix4 rows() const {
        RowMajor4 matrix = RowMajor4::Identity();
        matrix.topLeftCorner<3, 3>() = R;
        matrix.topRightCorner<3, 1>() = t;
        viso::Matrix4 out;
        Eigen::Map<RowMajor4>(out.data()) = matrix;
        return out;
    }
};

inline Eigen::Vector3d vector(const viso::Vector3& numbers) { return Eigen::Vector3d(numbers.data()); }
inline viso::Vector3 numbers(const Eigen::Vector3d& vector) { return {vector.x(), vector.y(), vector.z()}; }

// Return the variances in a start's covariance, at least those that keep a prior from being exact.
inline Eigen::Matrix<double, 15, 1> variances(const viso::Start& start) {
    const Eigen::Map<const Eigen::Matrix<double, 15, 15>> covariance(start.covariance.data());
    return covariance.diagonal().cwiseMax(1e-8);
}

// Tell the pose of the body relative to K.
inline void tell_pose(const Pose& K, const Pose& B, viso::Estimate& to) {
    to.world_T_body = B.rows();
    to.keyframe_T_body = (K.inverse() * B).rows();
}

// Tell the covariance of K and the body together, each (rotation, right perturbation; position, in the world).
inline void tell_covariance(Matrix12 joint, viso::Estimate& to) {
    joint.diagonal().tail<6>().array() += SMALLEST_SIGMA * SMALLEST_SIGMA;
    joint = 0.5 * (joint + joint.transpose()).eval();
    if (!joint.allFinite() || joint.selfadjointView<Eigen::Lower>().eigenvalues()[0] < -1e-12) return;
    Eigen::Map<Matrix12>(to.covariance.data()) = joint;  // symmetric: by rows as by columns
    to.covariance_kind = viso::CovarianceKind::JOINT;
}

// Counts the features of an image that agree with the estimate, and what they say.
class Inliers {
public:
    Inliers(double width, double height) : width_(width), height_(height) {}

    // Take a feature seen again: where, how far from where the estimate has it, the same squared by its sigma (two
    // degrees of freedom), and how far it has moved since K but for rotation.
    void take(double x, double y, double error_px, double chi2, double parallax_px) {
        ++tracked_;
        if (!(chi2 <= MAX_CHI2)) return;
        ++inliers_;
        errors_px_ += error_px;
        chi2_ += chi2;
        parallax_px_ += parallax_px;
        const int column = std::clamp(static_cast<int>(x / width_ * COLUMNS), 0, COLUMNS - 1);
        const int row = std::clamp(static_cast<int>(y / height_ * ROWS), 0, ROWS - 1);
        cells_.set(static_cast<std::size_t>(row * COLUMNS + column));
    }

    unsigned count() const { return inliers_; }

    void tell(viso::Estimate& to) const {
        to.tracked = tracked_;
        to.inliers = inliers_;
        if (inliers_ == 0) return;
        to.mre_px = errors_px_ / inliers_;
        to.mean_parallax_px = parallax_px_ / inliers_;
        to.innovation_ratio = chi2_ / 2 / inliers_;
        to.coverage = static_cast<double>(cells_.count()) / static_cast<double>(cells_.size());
    }

private:
    static constexpr int COLUMNS = 8, ROWS = 6;  // as the strategies of viso count
    double width_, height_, errors_px_ = 0, chi2_ = 0, parallax_px_ = 0;
    unsigned tracked_ = 0, inliers_ = 0;
    std::bitset<COLUMNS * ROWS> cells_;
};

// Return how far a point moves in the picture from one place of the camera to another but for rotation.
inline double parallax_px(const Eigen::Vector3d& point, const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                          double focal_px) {
    const Eigen::Vector3d a = (point - from).normalized(), b = (point - to).normalized();
    return focal_px * std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace adapter

#endif
