#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>

#include "datasets/sequence.h"
#include "datasets/synthetic_scene.h"

namespace cohort {

enum class DegradeRecipe { kPaper, kSensor };
inline constexpr ChoiceNames<DegradeRecipe, 2> kRecipeNames{
    {{"paper", DegradeRecipe::kPaper}, {"sensor", DegradeRecipe::kSensor}}};

struct DegradeOptions {
  DegradeRecipe recipe = DegradeRecipe::kPaper;
  double level = 1.0;  // 0 clean, 1 medium, 2 hard; as text: ParseLevel
  double occluder_px_per_frame = 0.0;
  unsigned seed = 1;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice(
        "recipe", o.recipe, kRecipeNames, "paper: darken, noise, blur, noise; sensor: a camera");
    v.Number("occluder_px_per_frame",
             o.occluder_px_per_frame,
             0.0,
             1000.0,
             "speed of an opaque bar, 80 px wide, that crosses the picture; 0: none");
    v.Number("seed", o.seed, 0U, 4294967295U, "of the noise and the bar's pattern");
  }
};

// Level by name: clean 0, medium 1, hard 2, or a number. Throws UsageError.
double ParseLevel(const std::string& text);

// What a level stands for. Gains and noise levels are interpolated geometrically between the
// table's three levels (and beyond hard extrapolated), except that `paper`'s blur and second noise,
// which clean has not, grow linearly from 0.
//   paper   clean g 1, noise .004 | medium g .3, s1 .04, blur 2 px, s2 .02 | hard g .2, .06, 2 px,
//   .03 sensor  clean gain 1, shot 1e-4 | medium gain .08, shot .006 | hard gain .04, shot .012;
//           log read = 2.18 log shot + 1.2
struct PaperLevel {
  double gain, noise_before, blur_px, noise_after;
};
struct SensorLevel {
  double gain, shot, read, motion_blur_px;
};
PaperLevel PaperLevelOf(double level);
SensorLevel SensorLevelOf(double level);

// One frame; `gray` is CV_8UC1 or CV_16UC1, the result CV_8UC1. Intensities 0..1:
//   paper   g v + s1 n, Gaussian blur, + s2 n
//   sensor  linear = gain v^2.2, a hand-shake blur of the exposure (a random straight smear, up to
//           motion_blur_px), noise of variance shot linear + read, digital gain back to a fifth of
//           the full range (what an automatic exposure does), gamma 1/2.2
// The noise of frame i is RandomStream(seed, "degrade/noise").Fork(i).
cv::Mat DegradeFrame(const cv::Mat& gray, const DegradeOptions& options, std::uint32_t frame);

// An opaque, textured bar, 80 px wide, that crosses the picture from the left again and again.
struct OccludedFrame {
  cv::Mat gray;
  cv::Mat mask;  // CV_8UC1, 255: covered
};
OccludedFrame DrawOccluder(const cv::Mat& gray, const DegradeOptions& options, std::uint32_t frame);

// Degrades a clip into a folder in TUM layout, with calibration, true poses, depth and scene.json
// where the source has them. The occluder is drawn before the degradation, as a real foreground
// would be. Whole or not at all.
void DegradeSequence(Sequence& sequence,
                     const std::filesystem::path& source,
                     const DegradeOptions& options,
                     const std::filesystem::path& out,
                     const Progress& progress = {});

}  // namespace cohort
