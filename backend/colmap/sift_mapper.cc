#include "backend/colmap/sift_mapper.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "backend/colmap/camera_model.h"
#include "backend/colmap/model_io.h"
#include "backend/colmap/program.h"
#include "frontend/core/error.h"
#include "frontend/core/statistics.h"
#include "frontend/core/stopwatch.h"
#include "frontend/image/levels.h"
#include "frontend/image/read_image.h"
#include "frontend/image/write_image.h"
#include "frontend/storage/output.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<ColmapArgument>;

// The outputs of an earlier run, which this one replaces, including SQLite's own files.
constexpr const char* kOwnEntries[] = {"images",
                                       "database.db",
                                       "database.db-wal",
                                       "database.db-shm",
                                       "sparse",
                                       "sparse_lenient",
                                       "colmap.log"};

template <typename T>
ColmapArgument Argument(std::vector<std::string> names, const T& value) {
  return {std::move(names), fmt::format("{}", value), false};
}

ColmapArgument Required(std::string name, const fs::path& value) {
  return {{std::move(name)}, value.string(), true};
}

std::string NameInWork(const FrameInfo& frame) {
  return fmt::format("{:06}.png", ToInt(frame.index));
}

// Stretches to 8 bits from the darkest to the brightest pixel, except for 0.5 % at either end.
cv::Mat Stretch(const cv::Mat& picture) {
  std::vector<double> values(picture.begin<float>(), picture.end<float>());
  const double low = Quantile(values, 0.005);
  const double high = Quantile(std::move(values), 0.995);
  const double scale = 255.0 / std::max(high - low, 1e-3);
  cv::Mat stretched;
  picture.convertTo(stretched, CV_8U, scale, -low * scale);
  return stretched;
}

void WriteFrames(const TrackFile& clip, const SiftOptions& options, const fs::path& folder) {
  fs::create_directories(folder);
  for (const FrameInfo& frame : clip.frames) {
    const fs::path path = fs::path(clip.image_root) / frame.name;
    cv::Mat picture = LevelsOf(ReadImage(path, cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH));
    if (options.denoise_sigma_px > 0.0) {
      cv::GaussianBlur(picture, picture, cv::Size(0, 0), options.denoise_sigma_px);
    }
    cv::Mat out;
    if (options.stretch) {
      out = Stretch(picture);
    } else {
      picture.convertTo(out, CV_8U);
    }
    WriteImage(folder / NameInWork(frame), out);
  }
}

Arguments LogArguments() {
  return {Argument({"log_to_stderr"}, 1),
          Argument({"log_target"}, "stderr"),
          Argument({"log_color"}, 0)};
}

Arguments ExtractorArguments(const TrackFile& clip, const SiftOptions& sift, int threads) {
  Arguments arguments = LogArguments();
  const auto add = [&](std::vector<std::string> names, auto value) {
    arguments.push_back(Argument(std::move(names), value));
  };
  add({"ImageReader.single_camera"}, 1);
  if (clip.camera) {
    const ColmapCamera camera = ToColmapCamera(*clip.camera);
    add({"ImageReader.camera_model"}, ColmapModelName(camera.model));
    add({"ImageReader.camera_params"}, fmt::format("{}", fmt::join(camera.params, ",")));
  }
  add({"SiftExtraction.use_gpu", "FeatureExtraction.use_gpu"}, 0);
  add({"SiftExtraction.num_threads", "FeatureExtraction.num_threads"}, threads);
  add({"SiftExtraction.max_num_features"}, sift.max_features);
  add({"SiftExtraction.peak_threshold"}, sift.peak_threshold);
  add({"SiftExtraction.first_octave"}, sift.first_octave);
  if (!sift.mask.empty()) arguments.push_back(Required("ImageReader.camera_mask_path", sift.mask));
  return arguments;
}

Arguments MatcherArguments(const ColmapOptions& options) {
  constexpr int kOverlap = 10;  // following frames to match with, and as many at doubling distances
  Arguments arguments = LogArguments();
  arguments.push_back(SeedArgument(options.seed));
  arguments.push_back(Argument({"SiftMatching.use_gpu", "FeatureMatching.use_gpu"}, 0));
  arguments.push_back(
      Argument({"SiftMatching.num_threads", "FeatureMatching.num_threads"}, options.threads));
  arguments.push_back(Argument({"SequentialMatching.overlap"}, kOverlap));
  arguments.push_back(Argument({"SequentialMatching.quadratic_overlap"}, 1));
  return arguments;
}

// COLMAP's bounds except for the one on forward motion; `lenient`: for few matches at small angles.
Arguments MapperArguments(const TrackFile& clip, const ColmapOptions& options, bool lenient) {
  Arguments arguments = LogArguments();
  const auto add = [&](std::string name, auto value) {
    arguments.push_back(Argument({std::move(name)}, value));
  };
  const int refine = clip.KnowsCamera() ? 0 : 1;
  arguments.push_back(SeedArgument(options.seed));
  add("Mapper.num_threads", options.threads);
  add("Mapper.extract_colors", 0);
  // If the first initial pair fails, another one is tried; the largest model counts.
  add("Mapper.multiple_models", 1);
  add("Mapper.max_num_models", 5);
  add("Mapper.ba_refine_focal_length", refine);
  add("Mapper.ba_refine_extra_params", refine);
  add("Mapper.ba_refine_principal_point", 0);
  add("Mapper.min_model_size", std::clamp(static_cast<int>(clip.frames.size() / 2), 2, 10));
  add("Mapper.init_max_forward_motion", 1.0);
  if (lenient) {
    add("Mapper.init_min_num_inliers", 30);
    add("Mapper.init_min_tri_angle", 2.0);
    add("Mapper.abs_pose_min_num_inliers", 12);
    add("Mapper.min_num_matches", 10);
  }
  return arguments;
}

// Replaces the image ids by ours, since the names identify the frames.
ColmapModel WithOurIds(const ColmapModel& model, const TrackFile& clip) {
  std::map<std::string, ColmapImageId> id_of_name;
  for (const FrameInfo& frame : clip.frames) {
    id_of_name[NameInWork(frame)] = ColmapImageIdOf(frame.index);
  }
  ColmapModel renamed;
  renamed.cameras = model.cameras;
  renamed.points = model.points;
  for (const auto& [id, image] : model.images) {
    const auto ours = id_of_name.find(image.name);
    if (ours == id_of_name.end()) {
      ThrowError("COLMAP's model has an image {}, which was not given to it", image.name);
    }
    if (!renamed.images.emplace(ours->second, image).second) {
      ThrowError("COLMAP's model has two images {}", image.name);
    }
  }
  for (auto& [id, point] : renamed.points) {
    for (auto& [image, index] : point.track) image = id_of_name.at(model.images.at(image).name);
  }
  return renamed;
}

Reconstruction ToReconstruction(const ColmapModel& model, const TrackFile& clip) {
  Reconstruction result = FromColmapModel(WithOurIds(model, clip));
  result.camera.known = clip.KnowsCamera();
  for (const FrameInfo& frame : clip.frames) {
    if (!result.cam_from_world.contains(frame.index)) continue;
    result.frame_names[frame.index] = frame.name;
    result.timestamps_ns[frame.index] = frame.timestamp_ns;
  }
  return result;
}

std::string DescribeFailure(const std::string& version,
                            const std::string& failure,
                            const fs::path& log) {
  return fmt::format("COLMAP {} registered no frame by SIFT{}{}; see {}",
                     version,
                     failure.empty() ? "" : ": ",
                     failure,
                     log.filename().string());
}

}  // namespace

ColmapResult ReconstructWithSift(const TrackFile& clip,
                                 const SiftOptions& sift,
                                 const ColmapOptions& options,
                                 const fs::path& work_folder) {
  ValidateOptions(sift);
  ValidateOptions(options);
  const fs::path work_dir = fs::absolute(work_folder);  // a leading dash would be an option
  const Stopwatch stopwatch;
  ColmapProgram program(options.program, options.max_minutes);
  for (const char* own : kOwnEntries) fs::remove_all(work_dir / own);
  const fs::path images = work_dir / "images";
  const fs::path database = work_dir / "database.db";
  WriteFrames(clip, sift, images);

  ColmapResult result;
  result.log = work_dir / "colmap.log";
  result.reconstruction.camera = clip.camera.value_or(Camera::Guess(clip.width_px, clip.height_px));
  const auto run = [&](const std::string& command, Arguments arguments, bool with_images) {
    arguments.push_back(Required("database_path", database));
    if (with_images) arguments.push_back(Required("image_path", images));
    const ProgramEnd end = program.Run(command, arguments, result.log);
    return end.Failed() ? fmt::format("{}: {}", command, end.Brief()) : std::string();
  };
  std::string failure =
      run("feature_extractor", ExtractorArguments(clip, sift, options.threads), true);
  if (failure.empty()) {
    failure = run("sequential_matcher", MatcherArguments(options), false);
  }
  std::optional<ColmapModelFolder> best;
  if (failure.empty()) {
    for (const bool lenient : {false, true}) {
      const fs::path sparse = work_dir / (lenient ? "sparse_lenient" : "sparse");
      fs::create_directories(sparse);
      Arguments arguments = MapperArguments(clip, options, lenient);
      arguments.push_back(Required("output_path", sparse));
      failure = run("mapper", arguments, true);
      std::vector<std::string> damaged;  // by a mapper that died while writing
      auto model = ReadLargestColmapModel(sparse, failure.empty() ? nullptr : &damaged);
      if (model && (!best || model->model.images.size() > best->model.images.size())) {
        best = std::move(model);
      }
      if (best && !TooFewRegistered(best->model.images.size(), clip.frames.size())) break;
    }
  }
  if (best) result.reconstruction = ToReconstruction(best->model, clip);
  fs::remove_all(images);
  fs::remove(database);

  result.summary = Summarize(result.reconstruction, clip.frames.size());
  result.summary.seconds = stopwatch.Seconds();
  result.summary.termination =
      best ? fmt::format("COLMAP {} with its own SIFT features", program.version())
           : DescribeFailure(program.version(), failure, result.log);
  return result;
}

}  // namespace cohort
