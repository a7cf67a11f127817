// What the length of a clip costs the Ceres backend, on tracks of exact geometry with noise of half
// a pixel: an orbit that keeps all points in sight, and a path on which a track lasts 60 frames.
//   length_benchmark [--benchmark_filter=orbit] [--benchmark_out=length.json ...]
// One benchmark a path and number of frames. Its counters:
//   seconds, adjust_seconds  of processor time: ReconstructWithCeres, and AdjustWithCeres as the
//                            second pass uses it
//   memory_mb                that either of them takes at its peak, beside the tracks
//   registered               frames
//   error_px                 of the cameras, as the scene would shift in the picture: ATE over the
//                            distance to the scene, in pixels
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <numbers>
#include <string>

#include "backend/mapper/mapper.h"
#include "frontend/core/part_times.h"
#include "frontend/core/random_stream.h"
#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

constexpr double kNoisePx = 0.5;
constexpr int kFeatures = 300;         // in a frame, about
constexpr int kTrackLength = 60;       // of the path
constexpr double kFramesOfTurn = 480;  // of the orbit
constexpr double kDistance = 5.0;      // from the camera to the middle of the scene

enum Path : std::int64_t { kOrbit, kAlong };

// The camera of a frame, held by a hand: it shakes by half a degree.
Rigid3 PoseOf(Path path, int frame, RandomStream& hand) {
  const double angle = path == kOrbit ? 2.0 * std::numbers::pi * frame / kFramesOfTurn : 0.0;
  const double way = path == kAlong ? 0.05 * frame : 0.0;
  const Eigen::AngleAxisd turn(angle, Eigen::Vector3d::UnitY());
  const Eigen::Vector3d shake =
      0.01 * Eigen::Vector3d(hand.Gaussian(), hand.Gaussian(), hand.Gaussian());
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(shake.norm(), shake.normalized()) *
                                    turn.inverse());
  const Eigen::Vector3d center = turn * Eigen::Vector3d(way, 0.0, -kDistance);
  return {rotation, -(rotation * center)};
}

test::SyntheticTracks MakeTracks(Path path, int frames) {
  RandomStream scene(1, "length_benchmark/scene");
  RandomStream hand(1, "length_benchmark/hand");
  RandomStream noise(1, "length_benchmark/noise");
  test::SyntheticTracks result;
  const Camera camera = test::SyntheticTracksOptions::DefaultCamera();
  result.file.source = "synthetic";
  result.file.width_px = camera.width_px;
  result.file.height_px = camera.height_px;
  result.file.camera = camera;
  for (int i = 0; i < frames; ++i) {
    const FrameIndex frame{static_cast<std::uint32_t>(i)};
    result.file.frames.push_back({frame, fmt::format("frame_{:06}.png", i), i * 33'333'333LL});
    result.cam_from_world[frame] = PoseOf(path, i, hand);
  }
  std::vector<Observation> observations;
  const int points =
      path == kOrbit ? kFeatures : kFeatures * (frames + kTrackLength) / kTrackLength;
  for (int p = 0; p < points; ++p) {
    const int first =
        path == kOrbit ? 0 : static_cast<int>(scene.Below(frames + kTrackLength)) - kTrackLength;
    const int end = path == kOrbit ? frames : std::min(frames, first + kTrackLength);
    Eigen::Vector3d point(
        scene.Uniform(-1.5, 1.5), scene.Uniform(-1.2, 1.2), scene.Uniform(-1.5, 1.5));
    if (path == kAlong) point.x() += 0.05 * (first + 0.5 * kTrackLength);
    for (int i = std::max(0, first); i < end; ++i) {
      const FrameIndex frame{static_cast<std::uint32_t>(i)};
      const auto xy = camera.Project(result.cam_from_world.at(frame) * point);
      if (!xy || !camera.Contains(*xy)) continue;
      Observation& o = observations.emplace_back();
      o.feature = FeatureId{static_cast<std::uint32_t>(p)};
      o.frame = frame;
      o.xy = *xy + kNoisePx * Eigen::Vector2d(noise.Gaussian(), noise.Gaussian());
    }
  }
  result.file.tracks = TrackSet::Build(std::move(observations));
  return result;
}

// A line of /proc/self/status [MB].
double StatusMb(const std::string& name) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(name + ":")) return std::stod(line.substr(name.size() + 1)) / 1024.0;
  }
  return std::nan("");
}

// The most memory that `work` takes [MB].
template <typename Work>
double PeakMb(const Work& work) {
  std::ofstream("/proc/self/clear_refs") << "5";  // the peak begins anew
  const double before_mb = StatusMb("VmRSS");
  work();
  return StatusMb("VmHWM") - before_mb;
}

void Length(benchmark::State& state) {
  const auto path = static_cast<Path>(state.range(0));
  const test::SyntheticTracks scene = MakeTracks(path, static_cast<int>(state.range(1)));
  for ([[maybe_unused]] auto _ : state) {
    MapperResult result;
    const double start_ms = ThreadCpuMs();
    const double reconstruct_mb = PeakMb([&] { result = ReconstructWithCeres(scene.file); });
    const double reconstructed_ms = ThreadCpuMs();
    const double adjust_mb = PeakMb([&] { AdjustWithCeres(scene.file, result.reconstruction); });
    state.counters["seconds"] = 1e-3 * (reconstructed_ms - start_ms);
    state.counters["adjust_seconds"] = 1e-3 * (ThreadCpuMs() - reconstructed_ms);
    state.counters["memory_mb"] = std::max(reconstruct_mb, adjust_mb);
    state.counters["registered"] = static_cast<double>(result.summary.registered);
    state.counters["error_px"] =
        test::AbsoluteTrajectoryError(result.reconstruction.cam_from_world, scene.cam_from_world) /
        kDistance * scene.file.camera->fx;
  }
}
BENCHMARK(Length)
    ->ArgNames({"path", "frames"})
    ->ArgsProduct({{kOrbit, kAlong}, {120, 480, 2000, 10000}})
    ->Iterations(1)
    ->Unit(benchmark::kSecond);

}  // namespace
}  // namespace cohort

BENCHMARK_MAIN();
