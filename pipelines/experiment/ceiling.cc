#include "pipelines/experiment/ceiling.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <memory>
#include <utility>

#include "datasets/truth/position_bound.h"
#include "frontend/core/keep.h"
#include "frontend/core/random_stream.h"
#include "frontend/track/loop/track_loop.h"
#include "pipelines/sfm/input.h"

namespace cohort {
namespace {

constexpr int kWindowPx = 21;
constexpr double kMaxSigmaPx = 3.0;

// Moves every feature to its true position.
class TruthMover final : public FeatureMover {
 public:
  TruthMover(TrackTruth& truth, const DegradeOptions& degrade)
      : truth_(truth), bound_(degrade, kWindowPx), seed_(degrade.seed) {}

  // Sets the next frame of the loop.
  void Show(FrameIndex frame, const cv::Mat& signal) {
    frame_ = frame;
    signal_ = PositionBound::Prepare(signal);
  }

  std::vector<Move> MoveFeatures(const Pyramid&) override {
    RandomStream random = RandomStream(seed_, "compare/ceiling").Fork(ToInt(frame_));
    std::vector<Move> moves;
    for (Feature& feature : features_) {
      Eigen::Vector2d normal;  // in variables, because C++ does not specify the order of arguments
      normal.y() = random.Gaussian();
      normal.x() = random.Gaussian();
      moves.push_back(MoveOf(feature, normal));
      feature.xy = moves.back().xy;
    }
    return moves;
  }

  void Keep(std::span<const std::uint8_t> keep) override { KeepOnly(keep, features_); }

  void Add(std::span<const Eigen::Vector2d> born, const Pyramid&) override {
    for (const Eigen::Vector2d& xy : born) features_.push_back({xy, truth_.Pick(frame_, xy)});
  }

 private:
  struct Feature {
    Eigen::Vector2d xy;
    std::optional<TrackTruth::Anchor> anchor;  // nullopt: the truth is unknown there
  };

  Move MoveOf(const Feature& feature, const Eigen::Vector2d& normal) const {
    Move move;
    move.state = ObservationState::kPredicted;
    move.xy = feature.xy;
    const auto position = feature.anchor ? truth_.Locate(*feature.anchor, frame_) : std::nullopt;
    if (!position) return move;
    move.xy = position->xy;
    if (!position->visible) return move;
    const auto covariance = bound_.Covariance(signal_, position->xy);
    if (!covariance) return move;
    const Eigen::Vector2d sigmas = covariance->selfadjointView<Eigen::Lower>().eigenvalues();
    if (sigmas.maxCoeff() > kMaxSigmaPx * kMaxSigmaPx) return move;
    move.state = ObservationState::kObserved;
    move.xy += covariance->llt().matrixL() * normal;
    move.covariance = PixelCovariance::From(*covariance);
    return move;
  }

  TrackTruth& truth_;
  PositionBound bound_;
  unsigned seed_;
  FrameIndex frame_{};
  PositionBound::Signal signal_;
  std::vector<Feature> features_;
};

// Without the tracks whose true points are unknown.
TrackSet OfKnownPoints(const TrackSet& tracks, TrackTruth& truth) {
  std::vector<Observation> observations;
  for (const FeatureId feature : tracks.features()) {
    const auto track = tracks.Track(feature);
    if (!truth.Pick(track.front().frame, track.front().xy)) continue;
    observations.insert(observations.end(), track.begin(), track.end());
  }
  return TrackSet::Build(std::move(observations));
}

}  // namespace

TrackFile MakeCeilingTracks(Sequence& clip,
                            Sequence& dark,
                            TrackTruth& truth,
                            const DegradeOptions& degrade,
                            const TrackerOptions& tracking) {
  auto owned = std::make_unique<TruthMover>(truth, degrade);
  TruthMover& mover = *owned;
  TrackLoop loop(tracking, std::move(owned));
  TrackFile file;
  std::vector<Observation> observations;
  while (const auto frame = dark.Next()) {
    const auto source = clip.Next();
    if (!source) ThrowError("{} has more frames than {}", dark.Name(), clip.Name());
    cv::Mat motion;
    if (degrade.recipe == DegradeRecipe::kSensor) {
      motion = TrueMotion(clip,
                          clip.KnownCamera(),
                          source->index,
                          clip.TrueDepth(source->index).value_or(cv::Mat()));
    }
    mover.Show(frame->index, NoiseFreeSignal(source->gray, degrade, ToInt(source->index), motion));
    const FrameResult result = loop.Track(*frame);
    observations.insert(observations.end(), result.observations.begin(), result.observations.end());
    file.frames.push_back(InfoOf(*frame));
    file.width_px = frame->gray.cols;
    file.height_px = frame->gray.rows;
  }
  file.tracks = OfKnownPoints(TrackSet::Build(std::move(observations)), truth);
  return file;
}

}  // namespace cohort
