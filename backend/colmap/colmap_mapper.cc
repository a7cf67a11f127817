#include "backend/colmap/colmap_mapper.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <optional>

#include "backend/colmap/initial_pair.h"
#include "backend/colmap/model_io.h"
#include "backend/colmap/program.h"
#include "backend/judge/aside.h"
#include "backend/scene/phrasebook.h"
#include "frontend/core/error.h"
#include "frontend/core/statistics.h"
#include "frontend/core/stopwatch.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/output.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<ColmapArgument>;

template <typename T>
ColmapArgument Argument(std::string name, const T& value) {
  return {{std::move(name)}, fmt::format("{}", value), false};
}

ColmapArgument Required(std::string name, const fs::path& value) {
  return {{std::move(name)}, value.string(), true};
}

// The folder in which COLMAP works, without the outputs of an earlier run.
struct Workspace {
  fs::path folder;
  fs::path database;
  fs::path log;
  fs::path images;  // COLMAP requires an existing folder even if it reads no image

  // Absolute, because COLMAP takes a path that begins with a dash as an option.
  Workspace(const fs::path& work_folder, const TrackFile& file)
      : folder(fs::absolute(work_folder)),
        database(folder / "database.db"),
        log(folder / "colmap.log") {
    std::error_code error;
    fs::create_directories(folder, error);
    if (error) ThrowError("cannot make folder {}: {}", folder.string(), error.message());
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().filename().string().starts_with("sparse")) fs::remove_all(entry.path());
    }
    fs::remove(log);
    images = file.image_root;
    if (images.empty() || !fs::is_directory(images)) {
      images = folder / "no_images";
      fs::create_directory(images);
    }
  }

  fs::path MakeFolder(const std::string& name) const {
    fs::create_directories(folder / name);
    return folder / name;
  }
};

// Number of observed positions in a frame, median over the frames that have any.
double MedianFeatures(const TrackSet& tracks) {
  std::vector<double> counts;
  for (const FrameIndex frame : tracks.frames()) {
    counts.push_back(static_cast<double>(ColmapKeypoints(tracks, frame).size()));
  }
  return Median(std::move(counts));
}

bool RefinesCamera(const TrackFile& file, const ColmapOptions& options) {
  return !file.KnowsCamera() && !options.hold_guess;
}

Arguments CommonArguments(const TrackFile& file,
                          const ColmapOptions& options,
                          const Workspace& workspace) {
  const bool refine = RefinesCamera(file, options);
  return {Required("database_path", workspace.database),
          Required("image_path", workspace.images),
          SeedArgument(options.seed),
          Argument("log_to_stderr", 1),
          Argument("log_target", "stderr"),
          Argument("log_color", 0),
          Argument("Mapper.num_threads", options.threads),
          Argument("Mapper.extract_colors", 0),
          Argument("Mapper.min_num_matches", options.database.two_view.min_inliers),
          Argument("Mapper.ba_refine_focal_length", refine ? 1 : 0),
          Argument("Mapper.ba_refine_extra_params", refine ? 1 : 0),
          Argument("Mapper.ba_refine_principal_point", 0),
          Argument("Mapper.filter_max_reproj_error", kMaxReprojectionPx),
          // Tracks of two frames are noise in a clip, but all that a clip of two frames has.
          Argument("Mapper.tri_ignore_two_view_tracks", file.frames.size() > 3 ? 1 : 0)};
}

// COLMAP's bounds are designed for photographs with thousands of SIFT features at wide angles. A
// clip has tens to hundreds of tracks, and consecutive frames share nearly all of them, so the
// bounds are scaled to the number of tracks and to the angle of the best pair.
Arguments MapperArguments(const TrackFile& file,
                          const ColmapOptions& options,
                          const Workspace& workspace,
                          const InitialPair* pair) {
  Arguments arguments = CommonArguments(file, options, workspace);
  const auto add = [&](const char* name, auto value) {
    arguments.push_back(Argument(name, value));
  };
  const double features = MedianFeatures(file.tracks);
  add("Mapper.multiple_models", 0);
  // This takes a third of the time and gives the same cameras, since neighbouring frames constrain
  // each other and a final adjustment follows anyway.
  if (options.fewer_adjustments) {
    arguments.push_back(
        {{"Mapper.ba_global_images_ratio", "Mapper.ba_global_frames_ratio"}, "1.4", false});
    add("Mapper.ba_global_points_ratio", 1.4);
    add("Mapper.ba_global_max_refinements", 2);
    add("Mapper.ba_global_function_tolerance", 1e-6);
  }
  add("Mapper.min_model_size", std::clamp(static_cast<int>(file.frames.size() / 2), 2, 10));
  add("Mapper.abs_pose_min_num_inliers", std::clamp(static_cast<int>(0.1 * features), 8, 30));
  if (pair == nullptr) {
    add("Mapper.init_min_num_inliers", std::clamp(static_cast<int>(0.4 * features), 15, 100));
    add("Mapper.init_min_tri_angle", 4.0);
    return arguments;
  }
  const TwoViewGeometry& g = pair->geometry;
  add("Mapper.init_image_id1", ColmapImageIdOf(pair->frame1));
  add("Mapper.init_image_id2", ColmapImageIdOf(pair->frame2));
  add("Mapper.init_min_num_inliers",
      std::clamp(static_cast<int>(0.5 * static_cast<double>(g.inlier_count)), 10, 100));
  add("Mapper.init_min_tri_angle", std::min(16.0, 0.4 * g.angle_deg));
  // The pair is already chosen, so COLMAP must not reject it for its forward motion.
  add("Mapper.init_max_forward_motion", 1.0);
  const double min_angle_deg = std::min(1.5, 0.4 * g.angle_deg);
  add("Mapper.tri_min_angle", min_angle_deg);
  add("Mapper.filter_min_tri_angle", min_angle_deg);
  return arguments;
}

Arguments AdjusterArguments(const TrackFile& file, const ColmapOptions& options) {
  const bool refine = RefinesCamera(file, options);
  return {SeedArgument(options.seed),
          Argument("log_to_stderr", 1),
          Argument("log_target", "stderr"),
          Argument("log_color", 0),
          Argument("BundleAdjustment.refine_focal_length", refine ? 1 : 0),
          Argument("BundleAdjustment.refine_extra_params", refine ? 1 : 0),
          Argument("BundleAdjustment.refine_principal_point", 0),
          {{"BundleAdjustment.function_tolerance", "BundleAdjustmentCeres.function_tolerance"},
           "1e-9",
           false}};
}

// COLMAP's own reason for its failure, from the part of the log after `offset`.
std::string FailureIn(const fs::path& log, std::size_t offset, const ProgramEnd& end) {
  constexpr std::uint64_t kMostBytes = 1 << 26;  // of the log's end
  std::ifstream in = OpenInputFile(log);
  const std::uint64_t size = fs::file_size(log);
  const std::uint64_t begin = std::max<std::uint64_t>(offset, size - std::min(size, kMostBytes));
  in.seekg(static_cast<std::streamoff>(begin));
  std::string text(begin < size ? size - begin : 0, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  constexpr std::pair<const char*, const char*> kPhrases[] = {
      {"No images with matches", "no images with matches"},
      {"No good initial image pair found", "no good initial image pair"},
      {"Initialization failed", "the initial pair was refused"},      // 3.8
      {"pair is insuitable for in", "the initial pair was refused"},  // 3.10
      {"pair is unsuitable for in", "the initial pair was refused"},  // 4.2
      {"No matching registered images", "no image could be registered"},
      {"Check failed", "COLMAP aborted on a failed check"},
  };
  for (const auto& [phrase, meaning] : kPhrases) {
    if (text.find(phrase) != std::string::npos) {
      return fmt::format("{} ({})", meaning, end.Brief());
    }
  }
  return end.Brief();
}

// Removes views that the adjustment left behind a camera or further off than the mapper's own
// bound, and points with fewer than two remaining views.
void RemoveOutliers(const TrackFile& file, Reconstruction& reconstruction) {
  reconstruction.camera.known = file.KnowsCamera();
  for (auto& [feature, point] : reconstruction.points) {
    std::erase_if(point.views, [&, in_world = point.in_world](const PointView& view) {
      const auto xy = CameraOf(reconstruction, view.frame)
                          .Project(reconstruction.cam_from_world.at(view.frame) * in_world);
      return !xy || (*xy - view.xy).norm() > kMaxReprojectionPx;
    });
  }
  std::erase_if(reconstruction.points, [](const auto& p) { return p.second.views.size() < 2; });
  UpdateReprojectionErrors(reconstruction);  // bundle_adjuster keeps the old ones
}

Reconstruction ToReconstruction(const ColmapModel& model, const TrackFile& file) {
  Reconstruction reconstruction = FromColmapModel(model, file);
  RemoveOutliers(file, reconstruction);
  return reconstruction;
}

// Writes the database, whose pairs include the initial pairs. Returns false if no two frames have a
// geometry.
bool WriteDatabase(const TrackFile& file,
                   const ColmapOptions& options,
                   const std::vector<InitialPair>& starts,
                   const fs::path& path) {
  std::vector<std::pair<FrameIndex, FrameIndex>> extra_pairs;
  for (const InitialPair& pair : starts) extra_pairs.emplace_back(pair.frame1, pair.frame2);
  const ColmapDatabase database =
      BuildColmapDatabase(file, options.database, extra_pairs, options.focal_scale);
  WriteColmapDatabase(path, database);
  return std::any_of(database.pairs.begin(), database.pairs.end(), [](auto& pair) {
    return pair.second.geometry.has_value();
  });
}

// The outcome of the mapper's runs.
struct MapperRuns {
  std::optional<ColmapModel> best;  // with the most images; nullopt if no run registered any
  // The index of its initial pair, or the number of pairs if COLMAP chose.
  std::size_t best_start = 0;
  std::string failure;  // reason of the last run that registered too few
  std::string died;     // how the best model's run ended, if abnormally
  std::string damaged;  // files that a run which died left half written
};

// One run from each initial pair, and a last one from COLMAP's own choice, until enough frames
// register.
MapperRuns RunMapper(ColmapProgram& program,
                     const TrackFile& file,
                     const ColmapOptions& options,
                     const Workspace& workspace,
                     const std::vector<InitialPair>& starts) {
  MapperRuns runs;
  for (std::size_t i = 0; i <= starts.size(); ++i) {
    const fs::path sparse = workspace.MakeFolder(fmt::format("sparse{}", i));
    const std::size_t log_bytes = fs::exists(workspace.log) ? fs::file_size(workspace.log) : 0;
    Arguments arguments =
        MapperArguments(file, options, workspace, i < starts.size() ? &starts[i] : nullptr);
    arguments.push_back(Required("output_path", sparse));
    const ProgramEnd end = program.Run("mapper", arguments, workspace.log);
    std::vector<std::string> damaged;
    auto model = ReadLargestColmapModel(sparse, end.Failed() ? &damaged : nullptr);
    if (!damaged.empty()) {
      runs.damaged = fmt::format(", a mapper run that ended with {} left an invalid model: {}",
                                 end.Brief(),
                                 damaged.front());
    }
    if (model && (!runs.best || model->model.images.size() > runs.best->images.size())) {
      runs.best = std::move(model->model);
      runs.best_start = i;
      runs.died = end.Failed() ? fmt::format(", though its mapper ended with {}", end.Brief()) : "";
    }
    if (runs.best && !TooFewRegistered(runs.best->images.size(), file.frames.size())) break;
    runs.failure = FailureIn(workspace.log, log_bytes, end);
  }
  return runs;
}

// The model that a run wrote; nullopt if the run failed, whatever it had written by then, or if its
// output is not a model.
std::optional<ColmapModel> ReadWritten(const fs::path& folder, const ProgramEnd& end) {
  if (end.Failed() || !fs::exists(folder / "points3D.bin")) return std::nullopt;
  try {
    return ReadColmapModel(folder);
  } catch (const Error& error) {
    spdlog::debug("{}", error.what());
    return std::nullopt;
  }
}

// Returns nullopt if it is not a model of one camera with our ids.
std::optional<Reconstruction> Converted(const ColmapModel& written) {
  try {
    return FromColmapModel(written);
  } catch (const Error& error) {
    spdlog::debug("{}", error.what());
    return std::nullopt;
  }
}

// Runs COLMAP's bundle_adjuster from this reconstruction to the optimum. Returns nullopt if it
// fails or loses cameras or points.
std::optional<Reconstruction> RunAdjuster(ColmapProgram& program,
                                          const TrackFile& file,
                                          const ColmapOptions& options,
                                          const Workspace& workspace,
                                          Reconstruction reconstruction) {
  const fs::path input = workspace.MakeFolder("sparse_single");
  const fs::path adjusted = workspace.MakeFolder("sparse_adjusted");
  WriteColmapModel(input, ToColmapModel(reconstruction), ColmapModelFormat::kBinary);
  Arguments arguments = AdjusterArguments(file, options);
  arguments.push_back(Required("input_path", input));
  arguments.push_back(Required("output_path", adjusted));
  const ProgramEnd end = program.Run("bundle_adjuster", arguments, workspace.log);
  const std::optional<ColmapModel> written = ReadWritten(adjusted, end);
  const std::optional<Reconstruction> moved = written ? Converted(*written) : std::nullopt;
  if (!moved) return std::nullopt;
  const bool has_all = std::ranges::all_of(reconstruction.points, [&moved](const auto& point) {
    return moved->points.contains(point.first);
  });
  const auto frame_of = [](const auto& pose) { return pose.first; };
  const bool has_same_frames = std::ranges::equal(
      moved->cam_from_world, reconstruction.cam_from_world, {}, frame_of, frame_of);
  if (!has_all || !has_same_frames) return std::nullopt;
  reconstruction.camera = moved->camera;
  reconstruction.focal_scale = moved->focal_scale;
  reconstruction.cam_from_world = moved->cam_from_world;
  for (auto& [feature, point] : reconstruction.points) {
    point.in_world = moved->points.at(feature).in_world;
  }
  RemoveOutliers(file, reconstruction);
  return reconstruction;
}

// The initial pair of the best run.
std::string DescribeStart(const MapperRuns& runs, const std::vector<InitialPair>& starts) {
  if (runs.best_start < starts.size()) return DescribeInitialPair(starts[runs.best_start]);
  return fmt::format("initial pair: chosen by COLMAP, since {}",
                     starts.empty() ? "no pair that cohort tried has a relative pose"
                                    : "none of cohort's registered more frames");
}

std::string DescribeEnd(const ColmapProgram& program,
                        std::size_t registered,
                        std::size_t frames,
                        const std::string& failure,
                        const std::string& start,
                        const std::string& died,
                        const fs::path& log) {
  if (registered == 0) {
    return fmt::format("COLMAP {} registered no frame: {}{}; see {} of the run",
                       program.version(),
                       failure,
                       died,
                       log.filename().string());
  }
  if (TooFewRegistered(registered, frames)) {
    return fmt::format("COLMAP {} registered only {} of {} frames (fewer than 80 %){}; {}",
                       program.version(),
                       registered,
                       frames,
                       died,
                       start);
  }
  return fmt::format("COLMAP {} done{}; {}", program.version(), died, start);
}

}  // namespace

ColmapResult ReconstructWithColmap(const TrackFile& tracked,
                                   const ColmapOptions& options,
                                   const fs::path& work_folder) {
  ValidateOptions(options);
  const TrackFile file = WithoutWeakObservations(tracked, options.database);
  const Stopwatch total;
  ColmapProgram program(options.program, options.max_minutes);
  const Workspace workspace(work_folder, file);

  ColmapResult result;
  result.log = workspace.log;
  result.reconstruction.camera = file.camera.value_or(Camera::Guess(file.width_px, file.height_px));
  const auto end = [&](std::string termination) {
    result.summary = SummarizeModelOf(file, result.reconstruction);
    result.summary.seconds = total.Seconds();
    result.summary.termination = std::move(termination);
    return result;
  };

  const Camera& camera = result.reconstruction.camera;
  TrackFile at_one_focal_length = file;
  at_one_focal_length.tracks = AtOneFocalLength(file.tracks, camera, options.focal_scale);
  const InitialPairs found = FindInitialPairs(at_one_focal_length, camera, options.max_attempts);
  if (found.end) return end(TerminationLine(*found.end));
  const std::vector<InitialPair>& starts = found.ranked;
  if (!WriteDatabase(file, options, starts, workspace.database)) {
    return end(TerminationLine(NoGeometryEnd(options.database.two_view.min_inliers)));
  }
  const MapperRuns runs = RunMapper(program, file, options, workspace, starts);
  std::string died = runs.died + runs.damaged;
  if (runs.best) {
    result.reconstruction = ToReconstruction(*runs.best, file);
    if (options.final_adjustment) {
      auto adjusted = RunAdjuster(program, file, options, workspace, result.reconstruction);
      if (adjusted) {
        result.reconstruction = std::move(*adjusted);
      } else {
        died += ", though its bundle_adjuster failed";
      }
    }
  }
  std::string failure = runs.failure;
  if (!result.reconstruction.cam_from_world.empty() && result.reconstruction.points.empty()) {
    // Cameras without any point are not a model, whatever produced them.
    result.reconstruction.cam_from_world.clear();
    failure = "its model has no points";
  }
  return end(DescribeEnd(program,
                         result.reconstruction.cam_from_world.size(),
                         file.frames.size(),
                         failure,
                         DescribeStart(runs, starts),
                         died,
                         workspace.log));
}

ColmapResult AdjustWithColmap(const TrackFile& tracked,
                              const Reconstruction& start,
                              const ColmapOptions& options,
                              const fs::path& work_folder) {
  ValidateOptions(options);
  const TrackFile file = WithoutWeakObservations(tracked, options.database);
  const Stopwatch total;
  ColmapProgram program(options.program, options.max_minutes);
  const Workspace workspace(work_folder, file);
  ColmapResult result;
  result.log = workspace.log;
  Reconstruction model = start;
  for (auto& [feature, point] : model.points) {
    std::vector<PointView> views;
    for (const PointView& view : point.views) {
      const Observation* o = file.tracks.Find(feature, view.frame);
      if (o == nullptr || !IsObserved(*o)) continue;
      views.push_back({view.frame, o->xy});
    }
    point.views = std::move(views);
  }
  RemoveOutliers(file, model);
  auto adjusted = RunAdjuster(program, file, options, workspace, std::move(model));
  if (adjusted) result.reconstruction = std::move(*adjusted);
  result.summary = SummarizeModelOf(file, result.reconstruction);
  result.summary.seconds = total.Seconds();
  result.summary.termination = fmt::format(
      "COLMAP {} {} a given model", program.version(), adjusted ? "adjusted" : "could not adjust");
  return result;
}

}  // namespace cohort
