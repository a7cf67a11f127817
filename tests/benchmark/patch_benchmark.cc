// How far the hot path is from what the machine can do: the operations on floats and the bytes of a
// patch, counted in the formulas of frontend/track/measure/patch_window.cc, over the time that it
// takes.
//   patch_benchmark [--benchmark_out=patches.json ...]
//
// Counters: operations, bytes        a patch: those of its n x n pixels (of lanes that are masked
//                                    none), each value that is read from picture and window once
//           operations_per_second    of one thread; of the two `roof` benchmarks what the machine
//                                    can do at most, without fused multiply-add, as we compile
#include <benchmark/benchmark.h>

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "frontend/core/random_stream.h"
#include "frontend/image/lanes.h"
#include "frontend/track/measure/patch_window.h"

namespace cohort {
namespace {

constexpr int kPlaces = 300;  // as many features take turns

cv::Mat Picture() {
  cv::Mat picture(480, 640, CV_32FC1);
  RandomStream random(1, "patch_benchmark/picture");
  for (auto it = picture.begin<float>(); it != picture.end<float>(); ++it) {
    *it = static_cast<float>(random.Uniform());
  }
  return picture;
}

std::vector<Eigen::Vector2d> Places() {
  RandomStream random(1, "patch_benchmark/places");
  std::vector<Eigen::Vector2d> places;
  for (int i = 0; i < kPlaces; ++i) {
    const double x = 40.0 + 560.0 * random.Uniform();
    places.emplace_back(x, 40.0 + 400.0 * random.Uniform());
  }
  return places;
}

void Count(benchmark::State& state, double operations, double floats) {
  state.counters["operations"] = operations;
  state.counters["bytes"] = sizeof(float) * floats;
  state.counters["operations_per_second"] =
      benchmark::Counter(operations, benchmark::Counter::kIsIterationInvariantRate);
}

double Square(double n) { return n * n; }

// Operations a pixel.
constexpr double kSampled = 9;      // three interpolations: a + w (b - a)
constexpr double kWarped = 15;      // its place, two weights, then as above
constexpr double kGradient = 14;    // Scharr's
constexpr double kFilled = 5;       // three sums, two means taken away
constexpr double kTranslated = 24;  // residual, gradients, eleven sums
constexpr double kWarpSummed = 47;  // residual, gradients, offsets, 34 sums
constexpr double kCompared = 10;

void Translation(benchmark::State& state) {
  const auto n = static_cast<int>(state.range(0));
  const cv::Mat picture = Picture();
  const auto places = Places();
  PatchWindow window;
  FillWindow(picture, places[0], n, window);
  std::size_t i = 0;
  for ([[maybe_unused]] auto _ : state) {
    benchmark::DoNotOptimize(LinearizeTranslation(picture, places[i++ % kPlaces], window));
  }
  Count(state,
        kSampled * Square(n + 2) + (kGradient + kTranslated) * Square(n),
        Square(n + 3) + 3 * Square(n));
}
BENCHMARK(Translation)->Arg(21)->Arg(31);

void Fill(benchmark::State& state) {
  const auto n = static_cast<int>(state.range(0));
  const cv::Mat picture = Picture();
  const auto places = Places();
  PatchWindow window;
  std::size_t i = 0;
  for ([[maybe_unused]] auto _ : state) {
    FillWindow(picture, places[i++ % kPlaces], n, window);
    benchmark::DoNotOptimize(window.values[0]);
  }
  Count(state,
        kSampled * Square(n + 2) + (kGradient + kFilled) * Square(n),
        Square(n + 3) + 3 * Square(n));
}
BENCHMARK(Fill)->Arg(21)->Arg(31);

void FillWarped(benchmark::State& state) {
  const auto n = static_cast<int>(state.range(0));
  const cv::Mat picture = Picture();
  const auto places = Places();
  Eigen::Matrix2d warp;
  warp << 1.03, 0.02, -0.03, 0.98;
  PatchWindow window;
  std::size_t i = 0;
  for ([[maybe_unused]] auto _ : state) {
    FillWarpedWindow(picture, places[i++ % kPlaces], warp, n, window);
    benchmark::DoNotOptimize(window.values[0]);
  }
  Count(state,
        kWarped * Square(n + 2) + (kGradient + kFilled) * Square(n),
        Square(n + 3) + 3 * Square(n));
}
BENCHMARK(FillWarped)->Arg(21)->Arg(31);

void Warp(benchmark::State& state) {
  const auto n = static_cast<int>(state.range(0));
  const cv::Mat picture = Picture();
  PatchWindow window;
  PatchWindow seen;
  FillWindow(picture, {100.3, 100.6}, n, window);
  FillWindow(picture, {100.8, 100.1}, n, seen);
  for ([[maybe_unused]] auto _ : state) benchmark::DoNotOptimize(LinearizeWarp(seen, window));
  Count(state, kWarpSummed * Square(n), 6 * Square(n));
}
BENCHMARK(Warp)->Arg(21)->Arg(31);

void Compare(benchmark::State& state) {
  const auto n = static_cast<int>(state.range(0));
  const cv::Mat picture = Picture();
  PatchWindow window;
  PatchWindow seen;
  FillWindow(picture, {100.3, 100.6}, n, window);
  FillWindow(picture, {100.8, 100.1}, n, seen);
  for ([[maybe_unused]] auto _ : state) benchmark::DoNotOptimize(CompareWindows(seen, window));
  Count(state, kCompared * Square(n), 2 * Square(n));
}
BENCHMARK(Compare)->Arg(21)->Arg(31);

constexpr int kChains = 12;  // more than the latency of a sum or product times two units
constexpr int kSteps = 1024;

COHORT_SIMD_CLONES void MultiplyAndAdd(float by, float* values) {
  FloatLanes chains[kChains];
  for (int c = 0; c < kChains; ++c) chains[c] = LoadLanes(values + c * kLanes);
  for (int i = 0; i < kSteps; ++i) {
    for (int c = 0; c < kChains; ++c) chains[c] = chains[c] * by + by;
  }
  for (int c = 0; c < kChains; ++c) StoreLanes(chains[c], values + c * kLanes);
}

void RoofOfOperations(benchmark::State& state) {
  std::array<float, kChains * kLanes> values{};
  for ([[maybe_unused]] auto _ : state) {
    MultiplyAndAdd(0.5F, values.data());
    benchmark::DoNotOptimize(values[0]);
  }
  Count(state, 2.0 * kSteps * kChains * kLanes, 0);
}
BENCHMARK(RoofOfOperations);

COHORT_SIMD_CLONES float Read(const float* values, std::size_t count) {
  FloatLanes sums[4] = {};
  for (std::size_t i = 0; i < count; i += 4 * kLanes) {
    for (int c = 0; c < 4; ++c) sums[c] += LoadLanes(values + i + c * kLanes);
  }
  return static_cast<float>(SumOf(sums[0] + sums[1] + sums[2] + sums[3]));
}

// Bytes a second from so many KB.
void RoofOfBytes(benchmark::State& state) {
  const std::vector<float> values(static_cast<std::size_t>(state.range(0)) * 1024 / sizeof(float),
                                  1.0F);
  for ([[maybe_unused]] auto _ : state)
    benchmark::DoNotOptimize(Read(values.data(), values.size()));
  state.counters["bytes_per_second"] =
      benchmark::Counter(static_cast<double>(sizeof(float) * values.size()),
                         benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(RoofOfBytes)->Arg(16)->Arg(1200);

}  // namespace
}  // namespace cohort

BENCHMARK_MAIN();
