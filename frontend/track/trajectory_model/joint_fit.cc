#include "frontend/track/trajectory_model/joint_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <vector>

#include "frontend/track/trajectory_model/feature_fit.h"
#include "frontend/track/trajectory_model/noise.h"

namespace cohort::trajectory_model {
namespace {

// One feature, taken out of the joint equations.
struct EliminatedFeature {
  // N_Cf of one camera: [1 z] (x) block, block = H' W J.
  struct Coupling {
    Eigen::Index frame;
    Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxDimensions> block;
  };
  Vector homogeneous;  // [1 z]
  Eigen::Matrix2d anchor_information;
  Matrix covariance;  // N_ff^-1
  Vector step;        // N_ff^-1 g_f: if the cameras stay
  std::vector<Coupling> couplings;
};

// The cameras' equations, and what has been taken out of them.
struct JointEquations {
  Eigen::MatrixXd normal;  // its lower triangle
  Eigen::VectorXd rhs;
  std::vector<EliminatedFeature> features;
  double cost = 0.0;  // at the linearisation
};

// Adds [1 z][1 z]' (x) block to the block of cameras k and l.
void AddBlock(const Matrix& zz,
              Eigen::Index k,
              Eigen::Index l,
              const Eigen::Matrix3d& block,
              Eigen::MatrixXd& normal) {
  const Eigen::Index columns = zz.rows();
  const Eigen::Index n = 3 * columns;
  for (Eigen::Index p = 0; p < columns; ++p) {
    for (Eigen::Index q = 0; q < columns; ++q) {
      normal.block<3, 3>(n * k + 3 * p, n * l + 3 * q) += zz(p, q) * block;
    }
  }
}

// Adds what a feature says of the cameras, itself eliminated.
void Eliminate(const State& state, std::size_t f, JointEquations& equations) {
  const Eigen::Index r = state.rank;
  const Eigen::Index n = 3 * (r + 1);
  const Feature& feature = state.features[f];
  const FeatureEquations own = EquationsOfFeature(state, f, Noise::kStudent);
  EliminatedFeature e;
  e.homogeneous.resize(r + 1);
  e.homogeneous << 1.0, feature.mean.head(r);
  e.anchor_information = own.anchor_information;
  e.covariance = own.information.llt().solve(Matrix::Identity(r + 2, r + 2));
  e.step = e.covariance * own.gradient;
  const Matrix zz = e.homogeneous * e.homogeneous.transpose();
  for (Eigen::Index l = 0; n * l < equations.rhs.size(); ++l) {
    const Frame& frame = state.frames[static_cast<std::size_t>(l)];
    const Observation& o = frame.observations[f];
    if (!o.IsObserved()) continue;
    const Projection at = Project(frame.camera, feature.mean);
    const Eigen::Vector2d d = Residual(at, o, feature);
    const Eigen::Matrix<double, 3, 2> HW =
        at.of_homogeneous.transpose() * RobustInformation(o, d, frame.misfit);
    EliminatedFeature::Coupling& c = e.couplings.emplace_back();
    c.frame = l;
    c.block.setZero(3, r + 2);
    c.block.leftCols(r) = HW * at.of_z;
    if (!o.anchor) c.block.rightCols(2) = HW;
    AddBlock(zz, l, l, HW * at.of_homogeneous, equations.normal);
    const Eigen::Vector3d g = HW * d - c.block * e.step;
    for (Eigen::Index p = 0; p <= r; ++p) {
      equations.rhs.segment<3>(n * l + 3 * p) += e.homogeneous[p] * g;
    }
  }
  for (std::size_t i = 0; i < e.couplings.size(); ++i) {
    const auto with_feature = (e.couplings[i].block * e.covariance).eval();
    for (std::size_t j = 0; j <= i; ++j) {
      AddBlock(zz,
               e.couplings[i].frame,
               e.couplings[j].frame,
               -with_feature * e.couplings[j].block.transpose(),
               equations.normal);
    }
  }
  equations.features.push_back(std::move(e));
}

JointEquations EquationsOf(const State& state, Eigen::Index frames) {
  const Eigen::Index n = 3 * (state.rank + 1);
  JointEquations equations;
  equations.normal = Eigen::MatrixXd::Zero(n * frames, n * frames);
  equations.rhs = Eigen::VectorXd::Zero(n * frames);
  for (std::size_t f = 0; f < state.features.size(); ++f) {
    Eliminate(state, f, equations);
    equations.cost +=
        CostOfFeature(state, f, equations.features[f].anchor_information, Noise::kStudent);
  }
  for (Eigen::Index l = 0; l < frames; ++l) {
    FixCameraGauge(state.perspective, equations.normal.block(n * l, n * l, n, n));
  }
  return equations;
}

// Moves cameras by `step`, their vec's below each other, and every feature by what follows of it.
// Returns the cost there.
double Move(const JointEquations& equations,
            const Eigen::VectorXd& step,
            const std::vector<Camera>& cameras,
            const std::vector<Feature>& features,
            State& state) {
  const Eigen::Index n = 3 * (state.rank + 1);
  const auto step_of = [&](Eigen::Index l) {
    return step.segment(n * l, n).reshaped(3, state.rank + 1);
  };
  for (std::size_t l = 0; l < cameras.size(); ++l) {
    state.frames[l].camera = cameras[l] + step_of(static_cast<Eigen::Index>(l));
  }
  double cost = 0.0;
  for (std::size_t f = 0; f < features.size(); ++f) {
    const EliminatedFeature& e = equations.features[f];
    Vector of_cameras = Vector::Zero(state.rank + 2);  // N_fC dC
    for (const EliminatedFeature::Coupling& c : e.couplings) {
      of_cameras += c.block.transpose() * (step_of(c.frame) * e.homogeneous);
    }
    state.features[f].mean = features[f].mean + e.step - e.covariance * of_cameras;
    cost += CostOfFeature(state, f, e.anchor_information, Noise::kStudent);
  }
  return cost;
}

}  // namespace

void JointFit::Step(State& state) {
  constexpr int kDampings = 5;
  constexpr double kLeastDamping = 1e-6;
  const std::size_t count = std::min(kFrames, state.frames.size());
  for (Frame& frame : state.frames) frame.misfit = MisfitOfFrame(frame, state.features);
  const JointEquations equations = EquationsOf(state, static_cast<Eigen::Index>(count));
  std::vector<Camera> cameras;
  for (std::size_t l = 0; l < count; ++l) cameras.push_back(state.frames[l].camera);
  const std::vector<Feature> features = state.features;
  for (int i = 0; i < kDampings; ++i) {
    Eigen::MatrixXd damped = equations.normal;
    damped.diagonal() *= 1.0 + damping_;
    const Eigen::VectorXd step = damped.selfadjointView<Eigen::Lower>().ldlt().solve(equations.rhs);
    if (Move(equations, step, cameras, features, state) <= equations.cost) {
      damping_ = std::max(0.1 * damping_, kLeastDamping);
      return;
    }
    damping_ *= 10.0;
  }
  damping_ = kFirstDamping;
  state.features = features;
  for (std::size_t l = 0; l < count; ++l) state.frames[l].camera = cameras[l];
}

}  // namespace cohort::trajectory_model
