#include "frontend/track/trajectory_model/joint_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <numeric>
#include <utility>
#include <vector>

#include "frontend/core/in_parallel.h"
#include "frontend/track/trajectory_model/feature_fit.h"
#include "frontend/track/trajectory_model/noise.h"
#include "frontend/track/trajectory_model/sized.h"

namespace cohort::trajectory_model {
namespace {

// One feature, eliminated from the joint equations.
template <int R>
struct EliminatedFeature {
  // N_Cf of one camera: [1 z] (x) block, block = H' W J.
  struct Coupling {
    std::size_t frame = 0;
    typename Sized<R>::Coupling block;
  };
  typename Sized<R>::Homogeneous homogeneous;  // [1 z]
  Eigen::Matrix2d anchor_information;
  double cost = 0.0;
  typename Sized<R>::Information covariance;  // N_ff^-1
  typename Sized<R>::Unknowns step;           // N_ff^-1 g_f: the step if the cameras do not move
  std::array<Coupling, JointFit::kMostFrames> couplings;
  std::size_t coupled = 0;
};

// The cameras' normal matrix while features are added. A feature contributes [1 z][1 z]' (x) M, M 3
// x 3, for cameras k and l. The lower triangle of the first factor suffices, and the sums, M's
// entries times those of the triangle, are contiguous.
class CameraSums {
 public:
  CameraSums(Eigen::Index columns, std::size_t frames)
      : columns_(columns), triangle_(columns * (columns + 1) / 2), frames_(frames) {
    sums_.assign(frames * (frames + 1) / 2 * static_cast<std::size_t>(9 * triangle_), 0.0);
  }

  // The lower triangle of [1 z][1 z]', for Add.
  template <typename Homogeneous>
  void SetFeature(const Homogeneous& z) {
    Eigen::Index i = 0;
    for (Eigen::Index p = 0; p < columns_; ++p) {
      for (Eigen::Index q = 0; q <= p; ++q) zz_[static_cast<std::size_t>(i++)] = z[p] * z[q];
    }
  }
  // Adds other sums over the same frames.
  void Add(const CameraSums& other) {
    for (std::size_t i = 0; i < sums_.size(); ++i) sums_[i] += other.sums_[i];
  }
  // k >= l.
  void Add(std::size_t k, std::size_t l, const Eigen::Matrix3d& M) {
    double* sum = sums_.data() + Offset(k, l);
    const double* m = M.data();
    for (Eigen::Index i = 0; i < triangle_; ++i, sum += 9) {
      const double z = zz_[static_cast<std::size_t>(i)];
      for (int j = 0; j < 9; ++j) sum[j] += z * m[j];
    }
  }
  // The lower triangle of the normal matrix of all vec(C).
  Eigen::MatrixXd Normal() const {
    const Eigen::Index n = 3 * columns_;
    const auto frames = static_cast<Eigen::Index>(frames_);
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n * frames, n * frames);
    for (Eigen::Index k = 0; k < frames; ++k) {
      for (Eigen::Index l = 0; l <= k; ++l) {
        const double* sum =
            sums_.data() + Offset(static_cast<std::size_t>(k), static_cast<std::size_t>(l));
        for (Eigen::Index p = 0; p < columns_; ++p) {
          for (Eigen::Index q = 0; q <= p; ++q, sum += 9) {
            const Eigen::Map<const Eigen::Matrix3d> block(sum);
            normal.block<3, 3>(n * k + 3 * p, n * l + 3 * q) = block;
            normal.block<3, 3>(n * k + 3 * q, n * l + 3 * p) = block;
          }
        }
      }
    }
    return normal;
  }

 private:
  std::size_t Offset(std::size_t k, std::size_t l) const {
    return (k * (k + 1) / 2 + l) * static_cast<std::size_t>(9 * triangle_);
  }

  Eigen::Index columns_;
  Eigen::Index triangle_;
  std::size_t frames_;
  std::vector<double> sums_;
  std::array<double, kMaxDimensions*(kMaxDimensions + 1) / 2> zz_{};
};

// The cameras' equations, and the eliminated features.
template <int R>
struct JointEquations {
  Eigen::MatrixXd normal;  // its lower triangle
  Eigen::VectorXd rhs;
  std::vector<EliminatedFeature<R>> features;
  double cost = 0.0;  // at the linearisation
};

// Eliminates a feature and adds its contribution to the cameras' equations.
template <int R>
EliminatedFeature<R> Eliminate(
    const State& state, std::size_t f, std::size_t frames, CameraSums& sums, Eigen::VectorXd& rhs) {
  const Eigen::Index r = state.rank;
  const Eigen::Index n = 3 * (r + 1);
  const FeaturePosterior& feature = state.features[f];
  const auto mean = Sized<R>::MeanOf(feature);
  const auto [own, cost] = EquationsAndCostOfFeature(state, f, Noise::kStudent);
  EliminatedFeature<R> e;
  e.homogeneous.resize(r + 1);
  e.homogeneous << 1.0, mean.head(r);
  e.anchor_information = own.anchor_information;
  e.cost = cost;
  e.covariance = InverseOf(own.information);
  e.step = e.covariance * own.gradient;
  sums.SetFeature(e.homogeneous);
  for (std::size_t l = 0; l < frames; ++l) {
    const Frame& frame = state.frames[l];
    const Observation& o = frame.observations[f];
    if (!o.IsObserved()) continue;
    const auto at = ProjectSized<R>(Sized<R>::Of(frame.camera), mean);
    const Eigen::Vector2d d = SizedResidual<R>(at, o, mean);
    const Eigen::Matrix<double, 2, 3> H = at.OfHomogeneous();
    const Eigen::Matrix<double, 3, 2> HW = H.transpose() * RobustInformation(o, d, frame.misfit);
    auto& c = e.couplings[e.coupled++];
    c.frame = l;
    c.block.setZero(3, r + 2);
    c.block.leftCols(r) = HW.lazyProduct(at.of_z);
    if (!o.anchor) c.block.template rightCols<2>() = HW;
    sums.Add(l, l, HW * H);
    const Eigen::Vector3d g = HW * d - c.block.lazyProduct(e.step);
    for (Eigen::Index p = 0; p <= r; ++p) {
      rhs.segment<3>(n * static_cast<Eigen::Index>(l) + 3 * p) += e.homogeneous[p] * g;
    }
  }
  for (std::size_t i = 0; i < e.coupled; ++i) {
    const typename Sized<R>::Coupling with_feature =
        -e.couplings[i].block.lazyProduct(e.covariance);
    for (std::size_t j = 0; j <= i; ++j) {
      sums.Add(e.couplings[i].frame,
               e.couplings[j].frame,
               with_feature.lazyProduct(e.couplings[j].block.transpose()));
    }
  }
  return e;
}

template <int R>
JointEquations<R> EquationsOf(const State& state, std::size_t frames) {
  const Eigen::Index n = 3 * (state.rank + 1);
  const std::size_t features = state.features.size();
  // The features are added in this many shares, independent of the number of threads, so that the
  // sums are always the same.
  constexpr std::size_t kShares = 8;
  std::vector<CameraSums> sums(kShares, CameraSums(state.rank + 1, frames));
  std::vector<Eigen::VectorXd> rhs(kShares,
                                   Eigen::VectorXd::Zero(n * static_cast<Eigen::Index>(frames)));
  JointEquations<R> equations;
  equations.features.resize(features);
  ForEachInParallel(kShares, [&](std::size_t i) {
    for (std::size_t f = i * features / kShares; f < (i + 1) * features / kShares; ++f) {
      equations.features[f] = Eliminate<R>(state, f, frames, sums[i], rhs[i]);
    }
  });
  for (std::size_t i = 1; i < kShares; ++i) {
    sums[0].Add(sums[i]);
    rhs[0] += rhs[i];
  }
  for (const EliminatedFeature<R>& feature : equations.features) equations.cost += feature.cost;
  equations.normal = sums[0].Normal();
  equations.rhs = std::move(rhs[0]);
  for (Eigen::Index l = 0; n * l < equations.rhs.size(); ++l) {
    FixCameraGauge(state.perspective, equations.normal.block(n * l, n * l, n, n));
  }
  return equations;
}

// Moves the cameras by `step`, the concatenation of their vecs, and every feature by the resulting
// step. Returns the cost there.
template <int R>
double Move(const JointEquations<R>& equations,
            const Eigen::VectorXd& step,
            const std::vector<Camera>& cameras,
            const std::vector<FeaturePosterior>& features,
            State& state) {
  const Eigen::Index n = 3 * (state.rank + 1);
  std::vector<typename Sized<R>::Camera> steps;
  for (std::size_t l = 0; l < cameras.size(); ++l) {
    steps.push_back(step.segment(n * static_cast<Eigen::Index>(l), n).reshaped(3, state.rank + 1));
    state.frames[l].camera = cameras[l] + steps.back();
  }
  std::vector<double> costs(features.size());
  ForEachInParallel(features.size(), [&](std::size_t f) {
    const EliminatedFeature<R>& e = equations.features[f];
    typename Sized<R>::Unknowns of_cameras = Sized<R>::Unknowns::Zero(state.rank + 2);  // N_fC dC
    for (std::size_t i = 0; i < e.coupled; ++i) {
      const auto& c = e.couplings[i];
      const Eigen::Vector3d moved = steps[c.frame].lazyProduct(e.homogeneous);
      of_cameras += c.block.transpose().lazyProduct(moved);
    }
    state.features[f].mean = features[f].mean + e.step - e.covariance.lazyProduct(of_cameras);
    costs[f] = CostOfFeature(state, f, e.anchor_information, Noise::kStudent);
  });
  return std::accumulate(costs.begin(), costs.end(), 0.0);
}

// Takes one step; returns false if none is found with five dampings.
template <int R>
bool SizedStep(State& state, std::size_t count, double& damping) {
  constexpr int kDampings = 5;
  constexpr double kLeastDamping = 1e-6;
  const JointEquations<R> equations = EquationsOf<R>(state, count);
  std::vector<Camera> cameras;
  for (std::size_t l = 0; l < count; ++l) cameras.push_back(state.frames[l].camera);
  const std::vector<FeaturePosterior> features = state.features;
  for (int i = 0; i < kDampings; ++i) {
    Eigen::MatrixXd damped = equations.normal;
    damped.diagonal() *= 1.0 + damping;
    const Eigen::VectorXd step = damped.selfadjointView<Eigen::Lower>().ldlt().solve(equations.rhs);
    if (Move(equations, step, cameras, features, state) <= equations.cost) {
      damping = std::max(0.1 * damping, kLeastDamping);
      return true;
    }
    damping *= 10.0;
  }
  state.features = features;
  for (std::size_t l = 0; l < count; ++l) state.frames[l].camera = cameras[l];
  return false;
}

}  // namespace

void JointFit::Step(State& state) {
  const std::size_t count = FramesOf(state);
  ForEachInParallel(state.frames.size(), [&](std::size_t l) {
    state.frames[l].misfit = MisfitOfFrame(state.frames[l], state.features);
  });
  const bool found = WithRank(
      state.rank, [&](auto rank) { return SizedStep<rank.value>(state, count, damping_); });
  if (!found) damping_ = kFirstDamping;
}

}  // namespace cohort::trajectory_model
