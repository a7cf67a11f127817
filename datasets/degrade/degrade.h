#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>

#include "datasets/degrade/video_encoder.h"
#include "datasets/readers/sequence.h"
#include "datasets/render/synthetic_scene.h"

namespace cohort {

enum class DegradeRecipe { kPaper, kSensor, kPhone };
inline constexpr ChoiceNames<DegradeRecipe, 3> kRecipeNames{{{"paper", DegradeRecipe::kPaper},
                                                             {"sensor", DegradeRecipe::kSensor},
                                                             {"phone", DegradeRecipe::kPhone}}};

struct DegradeOptions {
  DegradeRecipe recipe = DegradeRecipe::kPaper;
  double level = 1.0;  // 0 clean, 1 medium, 2 hard; as text: ParseLevel
  double light = 1.0;
  double occluder_px_per_frame = 0.0;
  VideoCodec codec = VideoCodec::kH264;
  int bitrate_kbit = 0;  // 0: PhoneBitrateKbit
  unsigned seed = 1;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice(
        "recipe",
        o.recipe,
        kRecipeNames,
        "The model of darkness. paper darkens, adds noise, blurs and adds noise again; sensor "
        "simulates a camera that receives little light; phone simulates how a phone processes the "
        "same light: exposure in steps, denoising and compressed video (needs the program ffmpeg).",
        Tier::kCommon);
    v.Number("light",
             o.light,
             1e-4,
             1.0,
             "The share of the level's light that is left with recipes sensor and phone; 0.125 is "
             "three stops less, at the same exposure and sensor noise.",
             Tier::kCommon);
    v.Number("occluder_px_per_frame",
             o.occluder_px_per_frame,
             0.0,
             1000.0,
             "The speed of an opaque bar, 80 px wide, that crosses the picture [px per "
             "frame]; 0: no bar.",
             Tier::kCommon);
    v.Choice("codec",
             o.codec,
             kVideoCodecNames,
             "The codec of the video with recipe phone; hevc preserves more detail at the same bit "
             "rate.",
             Tier::kCommon);
    v.Number("bitrate_kbit",
             o.bitrate_kbit,
             0,
             1000000,
             "The bit rate of the video with recipe phone [kbit/s]; a lower one loses more of the "
             "faint detail. 0: that of phones, 2500 for 640 x 480 pixels at 30 frames per second "
             "and in proportion.",
             Tier::kCommon);
    v.Number("seed",
             o.seed,
             0U,
             4294967295U,
             "The seed of the noise, of the bar's pattern and of the phone's exposure; another "
             "seed gives different noise of the same strength.",
             Tier::kCommon);
  }
};

// Level by name: clean 0, medium 1, hard 2, or a number. Throws UsageError.
double ParseLevel(const std::string& text);

// The parameters of a level: piecewise linear through the table's three levels and beyond hard,
// gains and shot in their logarithm, blur up to 2 px, shutter up to 1.
//   paper    clean                medium                           hard
//            gain 1, noise .004   gain .3, .04, blur 2 px, .02     gain .2, .06, blur 2 px, .03
//   sensor   gain 1, shot 1e-4,   gain .08, shot .006, shutter .35 gain .04, shot .012, shutter .6
//            shutter 0            log read = 2.18 log shot + 1.2
//   phone    the sensor of the same level
struct PaperLevel {
  double gain, noise_before, blur_px, noise_after;
};
struct SensorLevel {
  double gain, shot, read;
  double digital_gain;  // back to a fifth of the full range, as automatic exposure does
  double shutter;       // open for this share of the time between frames
};
PaperLevel PaperLevelAt(double level);
SensorLevel SensorLevelAt(double level, double light = 1.0);  // gain times light

// Degrades one frame; `gray` is CV_8UC1 or CV_16UC1, the result CV_8UC1. With v in 0..1 and n
// normal noise:
//   paper   g v + s1 n, Gaussian blur, + s2 n
//   sensor  linear = gain v^2.2, blurred by motion, + noise of variance shot linear + read, digital
//           gain, cut to 0..1, ^(1/2.2)
// `motion` [px a frame, CV_32FC2] smears half forwards, half backwards, so that nothing is
// displaced; if empty, up to 5 px of the whole picture. Random numbers: RandomStream(seed,
// "degrade/noise"). For phone, whose frames depend on earlier ones, use DegradeSequence.
cv::Mat DegradeFrame(const cv::Mat& gray,
                     const DegradeOptions& options,
                     std::uint32_t frame,
                     const cv::Mat& motion = {});

// Sensor and phone: the sensor's measurement, before digital gain and gamma, CV_32FC1.
cv::Mat MeasuredLight(const cv::Mat& gray,
                      const DegradeOptions& options,
                      std::uint32_t frame,
                      const cv::Mat& motion = {});

// The same frame without noise, digital gain, gamma and 8 bits, CV_32FC1: the signal that the noise
// is added to. Sensor and phone: in linear light.
cv::Mat NoiseFreeSignal(const cv::Mat& gray,
                        const DegradeOptions& options,
                        std::uint32_t frame,
                        const cv::Mat& motion = {});

// The motion of the picture by the true camera over one frame about `frame`: `motion` above. Empty
// without true poses, camera or depth.
cv::Mat TrueMotion(const Sequence& sequence,
                   const std::optional<Camera>& camera,
                   FrameIndex frame,
                   const cv::Mat& depth_m);

// Draws an opaque, textured bar, 80 px wide, that crosses the picture from the left repeatedly;
// between crossings it is absent for as long as one takes.
struct OccludedFrame {
  cv::Mat gray;
  cv::Mat mask;  // CV_8UC1, 255: covered
};
OccludedFrame DrawOccluder(const cv::Mat& gray, const DegradeOptions& options, std::uint32_t frame);

// Degrades a clip into a folder in TUM layout, with calibration, true poses, depth and scene.json
// if the source has them. `source` is the path that `sequence` was opened from, `camera` that of
// its pictures, if known. The occluder is drawn first, like a real foreground. Motion blur follows
// the true cameras if there are poses and depth (independently moving bodies are blurred as if
// static). Whole or not at all; the bytes do not depend on `threads` (0: one per core).
//   phone    MeasuredLight, PhoneCamera (phone_camera.h), VideoEncoder at the clip's frame rate
//            (the median of its first 32 time stamps' distances), decoded as any video. `sequence`
//            is read from its beginning.
void DegradeSequence(Sequence& sequence,
                     const std::filesystem::path& source,
                     const std::optional<Camera>& camera,
                     const DegradeOptions& options,
                     const std::filesystem::path& out,
                     const Progress& progress = {},
                     unsigned threads = 0);

}  // namespace cohort
