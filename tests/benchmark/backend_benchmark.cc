// What the Ceres backend has to hold, measured:
//   backend_benchmark rendered --work DIR   against COLMAP's mapper on tracks of rendered clips
//   backend_benchmark synthetic             the same on generated tracks
//   backend_benchmark refined --work DIR    what a second pass gains on the rendered clips
//   backend_benchmark scaling               time and memory from 250 to 1000 frames
//   backend_benchmark hard                  what it says of input that is hard or impossible
//   backend_benchmark real                  real tracks ($COHORT_DATA)
// One thread each. Times are processor seconds (of this process; of COLMAP as a child). Camera
// errors are ATE, after the best similarity, in mm (in thousandths of the scene's unit, the length
// of a path being about 2, where tracks are generated).
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cmath>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <tuple>
#include <vector>

#include "backend/colmap/colmap_mapper.h"
#include "backend/colmap/model_io.h"
#include "backend/mapper/mapper.h"
#include "datasets/open_sequence.h"
#include "tests/support/program.h"
#include "tests/support/shared_data.h"
#include "tests/support/shared_tracks.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using test::CameraPath;
using test::SyntheticTracks;
using test::SyntheticTracksOptions;
using Poses = std::map<FrameIndex, Rigid3>;

struct Run {
  std::size_t registered = 0;
  double ate = 0.0;
  double seconds = 0.0;
};

double CpuSeconds(int who) {
  rusage usage{};
  getrusage(who, &usage);
  const auto seconds = [](const timeval& t) { return t.tv_sec + 1e-6 * t.tv_usec; };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double Error(const Reconstruction& reconstruction, const Poses& truth) {
  if (reconstruction.cam_from_world.size() < 3 || truth.empty()) return std::nan("");
  return 1e3 * test::AbsoluteTrajectoryError(reconstruction.cam_from_world, truth);
}

Run RunCeres(const TrackFile& file, const Poses& truth, bool covariances) {
  MapperOptions options;
  options.whitening.use_covariances = covariances;
  const double start = CpuSeconds(RUSAGE_SELF);
  const MapperResult result = ReconstructWithCeres(file, options);
  const double seconds = CpuSeconds(RUSAGE_SELF) - start;
  return {result.summary.registered, Error(result.reconstruction, truth), seconds};
}

// COLMAP's mapper alone on the very same tracks, at its own pace; or as `cohort reconstruct` runs
// it, with fewer adjustments and without weak observations. The initial pair and bounds fit for the
// number of tracks are ours, since with its own it often finds no start; one attempt, no adjustment
// after it.
Run RunColmap(const TrackFile& file, const Poses& truth, bool as_cohort_runs_it) {
  const test::TempDir folder;
  ColmapOptions options;
  options.max_attempts = 1;
  options.fewer_adjustments = as_cohort_runs_it;
  if (!as_cohort_runs_it) options.database.max_relative_sigma = 0.0;  // the very same tracks
  options.final_adjustment = false;
  const double start = CpuSeconds(RUSAGE_CHILDREN);
  const ColmapResult result = ReconstructWithColmap(file, options, folder.path());
  const double seconds = CpuSeconds(RUSAGE_CHILDREN) - start;
  return {result.summary.registered, Error(result.reconstruction, truth), seconds};
}

// Geometric, of numbers whose logarithms these are.
double Mean(const std::vector<double>& logs) {
  double sum = 0.0;
  for (const double l : logs) sum += l;
  return std::exp(sum / static_cast<double>(logs.size()));
}

// A table of both backends on the same tracks, and its geometric means.
class Race {
 public:
  explicit Race(bool covariances) : covariances_(covariances), name_width_(covariances ? 26 : 42) {
    fmt::print("{:<{}}|{:^22}|{}{:^22}|{:^22}|\n",
               "",
               name_width_,
               "Ceres",
               covariances ? fmt::format("{:^22}|", "with covariances") : "",
               "COLMAP mapper",
               "as cohort runs it");
    const std::string columns = fmt::format("{:>6}{:>9}{:>7}|", "frames", "ATE", "cpu s");
    fmt::print("{:<{}}|{}{}{}{}\n",
               "",
               name_width_,
               columns,
               covariances ? columns : "",
               columns,
               columns);
  }

  void Add(const std::string& name, const TrackFile& file, const Poses& truth) {
    fmt::print("{:<{}}|", name, name_width_);
    const auto print = [](const Run& run) {
      fmt::print("{:>6}{:>9.3f}{:>7.2f}|", run.registered, run.ate, run.seconds);
      std::fflush(stdout);
      return run;
    };
    const Run plain = print(RunCeres(file, truth, false));
    Run weighed = plain;
    if (covariances_) weighed = print(RunCeres(file, truth, true));
    const Run colmap = print(RunColmap(file, truth, false));
    const Run fast = print(RunColmap(file, truth, true));
    fmt::print("\n");
    const std::size_t most = std::max(colmap.registered, fast.registered);
    if (plain.registered < most || weighed.registered < most) ++fewer_frames_;
    // A model of a few frames has a small error: it is no success to compare with.
    const std::size_t enough = (file.frames.size() * 8 + 9) / 10;
    if (plain.registered >= enough && weighed.registered >= enough) ++ours_;
    if (colmap.registered >= enough) ++colmaps_;
    if (std::min({plain.registered, weighed.registered, colmap.registered}) < enough) return;
    ate_.push_back(std::log(plain.ate / colmap.ate));
    ate_weighed_.push_back(std::log(weighed.ate / colmap.ate));
    speed_.push_back(std::log(colmap.seconds / weighed.seconds));
    if (fast.registered >= enough) {
      ate_fast_.push_back(std::log(weighed.ate / fast.ate));
      speed_fast_.push_back(std::log(fast.seconds / weighed.seconds));
    }
  }

  void Conclude() const {
    fmt::print(
        "80 % of the frames registered: {} of ours, {} of COLMAP's; fewer frames than "
        "COLMAP: {}\n",
        ours_,
        colmaps_,
        fewer_frames_);
    if (ate_.empty()) return;
    fmt::print("geometric means of {}: ATE / COLMAP's {:.3f}", ate_.size(), Mean(ate_));
    if (covariances_) fmt::print(", with covariances {:.3f}", Mean(ate_weighed_));
    fmt::print("; COLMAP's time / ours {:.1f}\n", Mean(speed_));
    if (speed_fast_.empty()) return;
    fmt::print("against COLMAP as cohort runs it: ATE {:.3f}, time {:.1f}\n",
               Mean(ate_fast_),
               Mean(speed_fast_));
  }

 private:
  bool covariances_;
  int name_width_;  // no line wider than 120 characters
  int fewer_frames_ = 0;
  int ours_ = 0;
  int colmaps_ = 0;
  std::vector<double> ate_;
  std::vector<double> ate_weighed_;
  std::vector<double> ate_fast_;
  std::vector<double> speed_;
  std::vector<double> speed_fast_;
};

struct RenderedOptions {
  std::string work;
  std::vector<std::string> clips{"room:lateral",
                                 "corridor:forward",
                                 "street:lateral",
                                 "tabletop:orbit",
                                 "facade:lateral",
                                 "shelves:forward"};
  std::vector<std::string> levels{"clean", "medium", "hard"};
  std::string tracker = "subspace";
  int frames = 120;
  int features = 400;
};

void Cohort(const std::string& arguments) {
  const test::ProgramEnd end = test::RunCohort(arguments + " --quiet");
  if (end.exit_code != 0) ThrowError("cohort {}: {}", arguments, end.err);
}

// A clip's tracks and truth.
struct Tracked {
  std::string name;
  fs::path tracks;
  Poses truth;
};

// Clips and tracks are made once and kept in the work folder. Tracks with the tracker's second
// pass, or without.
template <typename Use>
void ForEachClip(const RenderedOptions& o, bool second_pass, const Use& use) {
  fs::create_directories(o.work);
  for (const std::string& clip : o.clips) {
    const auto colon = clip.find(':');
    const std::string base =
        fmt::format("{}/{}_{}", o.work, clip.substr(0, colon), clip.substr(colon + 1));
    if (!fs::exists(base)) {
      Cohort(fmt::format("synth {} --scene {} --motion {} --frames {}",
                         base,
                         clip.substr(0, colon),
                         clip.substr(colon + 1),
                         o.frames));
    }
    for (const std::string& level : o.levels) {
      const std::string seen = fmt::format("{}_{}", base, level);
      const std::string tracks = fmt::format("{}_{}_{}_{}{}.tracks",
                                             seen,
                                             o.tracker,
                                             o.features,
                                             o.frames,
                                             second_pass ? "" : "_online");
      if (!fs::exists(seen)) Cohort(fmt::format("degrade {} {} --level {}", base, seen, level));
      if (!fs::exists(tracks)) {
        Cohort(
            fmt::format("track {} --out {} --tracker {} --features {} --frames 0:{} --threads 1 "
                        "--second-pass {}",
                        seen,
                        tracks,
                        o.tracker,
                        o.features,
                        o.frames,
                        second_pass ? "on" : "off"));
      }
      use(Tracked{
          fs::path(seen).filename().string(), tracks, OpenSequence(seen)->TrueCamFromWorld()});
    }
  }
}

void Rendered(const RenderedOptions& o) {
  Race race(true);
  ForEachClip(o, true, [&](const Tracked& clip) {
    race.Add(clip.name, ReadTrackFile(clip.tracks), clip.truth);
  });
  race.Conclude();
}

void Refined(const RenderedOptions& o) {
  fmt::print("{:<28}|{:^23}|{:^23}|{:^23}|\n", "", "first pass", "second pass", "third pass");
  const std::string columns = fmt::format("{:>7}{:>8}{:>8}|", "frames", "length", "ATE");
  fmt::print("{:<28}|{}{}{}\n", "", columns, columns, columns);
  std::array<std::vector<double>, 2> gains;
  ForEachClip(o, false, [&](const Tracked& clip) {
    fmt::print("{:<28}|", clip.name);
    const test::TempDir dir;
    std::string tracks = clip.tracks.string();
    double first = 0.0;
    for (int pass = 0; pass < 3; ++pass) {
      const std::string model = dir / fmt::format("model{}", pass);
      const MapperResult result = ReconstructWithCeres(ReadTrackFile(tracks));
      const double ate = Error(result.reconstruction, clip.truth);
      fmt::print("{:>7}{:>8.1f}{:>8.3f}|",
                 result.summary.registered,
                 result.summary.mean_track_length,
                 ate);
      std::fflush(stdout);
      if (pass == 0) first = ate;
      if (pass > 0) gains[pass - 1].push_back(std::log(ate / first));
      if (pass == 2 || result.reconstruction.points.empty()) break;
      WriteReconstruction(model, result.reconstruction);
      const std::string refined = dir / fmt::format("{}.tracks", pass);
      Cohort(fmt::format("refine {} --model {} --out {}", tracks, model, refined));
      tracks = refined;
    }
    fmt::print("\n");
  });
  fmt::print("geometric means of {}: ATE / the first pass's {:.3f}, {:.3f}\n",
             gains[0].size(),
             Mean(gains[0]),
             Mean(gains[1]));
}

struct SyntheticOptions {
  int frames = 120;
  int features = 400;
  int seeds = 2;
};

// Tracks of which about `features` are in sight in each frame.
SyntheticTracks MakeTracks(SyntheticTracksOptions options, int features) {
  options.points = 500;
  const SyntheticTracks probe = test::MakeSyntheticTracks(options);
  const double seen = static_cast<double>(probe.file.tracks.observations().size()) / options.frames;
  options.points = static_cast<int>(500.0 * features / seen);
  return test::MakeSyntheticTracks(options);
}

SyntheticTracksOptions Clip(
    CameraPath path, int frames, double noise_px, double outliers, double missing) {
  SyntheticTracksOptions options;
  options.path = path;
  options.frames = frames;
  options.noise_px = noise_px;
  options.outlier_fraction = outliers;
  options.missing_fraction = missing;
  options.max_track_length = 40;
  return options;
}

SyntheticTracksOptions Shallow(SyntheticTracksOptions options, double relief) {
  options.plane_relief = relief;
  return options;
}

SyntheticTracksOptions Drifting(SyntheticTracksOptions options, double drift_px) {
  options.drift_px = drift_px;
  return options;
}

struct Case {
  const char* name;
  SyntheticTracksOptions options;
};

void Synthetic(const SyntheticOptions& o) {
  Race race(false);
  for (auto& [name, options] : std::vector<Case>{
           {"arc", Clip(CameraPath::kArc, o.frames, 0.5, 0.0, 0.0)},
           {"lateral", Clip(CameraPath::kLateral, o.frames, 0.5, 0.0, 0.0)},
           {"forward", Clip(CameraPath::kForward, o.frames, 0.5, 0.0, 0.0)},
           {"nearly planar", Shallow(Clip(CameraPath::kLateral, o.frames, 0.5, 0.0, 0.0), 0.05)},
           {"arc, wrong, missing, 1 px", Clip(CameraPath::kArc, o.frames, 1.0, 0.1, 0.3)},
           {"forward, wrong, missing, 1 px", Clip(CameraPath::kForward, o.frames, 1.0, 0.1, 0.3)},
       }) {
    for (int seed = 1; seed <= o.seeds; ++seed) {
      options.seed = static_cast<std::uint64_t>(seed);
      const SyntheticTracks tracks = MakeTracks(options, o.features);
      race.Add(fmt::format("{}, seed {}", name, seed), tracks.file, tracks.cam_from_world);
    }
  }
  race.Conclude();
}

// In a child process, so that its memory is its own.
template <typename Body>
void InChild(const Body& body) {
  std::fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    body();
    std::fflush(stdout);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (status != 0) fmt::print("failed\n");
}

void Scaling() {
  fmt::print("{:>7}{:>14}{:>11}{:>9}{:>13}{:>9}{:>9}\n",
             "frames",
             "observations",
             "registered",
             "cpu s",
             "ms / frame",
             "MB",
             "ATE");
  for (const int frames : {250, 500, 1000}) {
    InChild([frames] {
      // A path as long as the clip: twice the frames see twice the scene.
      SyntheticTracksOptions options = Clip(CameraPath::kLateral, frames, 0.5, 0.0, 0.0);
      options.path_length = frames / 250.0;
      const SyntheticTracks tracks = MakeTracks(options, 200);
      const Run run = RunCeres(tracks.file, tracks.cam_from_world, false);
      rusage usage{};
      getrusage(RUSAGE_SELF, &usage);
      fmt::print("{:>7}{:>14}{:>11}{:>9.2f}{:>13.2f}{:>9.0f}{:>9.3f}\n",
                 frames,
                 tracks.file.tracks.observations().size(),
                 run.registered,
                 run.seconds,
                 1e3 * run.seconds / frames,
                 usage.ru_maxrss / 1024.0,
                 run.ate);
    });
  }
}

void Hard(int seeds) {
  const auto untracked = [](SyntheticTracksOptions options) {
    options.max_track_length = 0;
    return options;
  };
  const auto turning = [&](double noise) { return Clip(CameraPath::kRotation, 120, noise, 0, 0); };
  const auto still = [&](double noise) { return Clip(CameraPath::kStatic, 120, noise, 0, 0); };
  const auto lateral = [&](double noise) { return Clip(CameraPath::kLateral, 120, noise, 0, 0); };
  for (auto& [name, options] : std::vector<Case>{
           {"arc, 10 % wrong, 30 % missing, 1 px", Clip(CameraPath::kArc, 120, 1.0, 0.1, 0.3)},
           {"lateral, the same", Clip(CameraPath::kLateral, 120, 1.0, 0.1, 0.3)},
           {"forward, the same", Clip(CameraPath::kForward, 120, 1.0, 0.1, 0.3)},
           {"forward", Clip(CameraPath::kForward, 120, 0.5, 0.0, 0.0)},
           {"nearly planar, relief 5 %", Shallow(lateral(0.5), 0.05)},
           {"nearly planar, relief 1 %", Shallow(lateral(0.5), 0.01)},
           {"a plane", Shallow(lateral(0.5), 0.0)},
           {"a plane on an arc", Shallow(Clip(CameraPath::kArc, 120, 0.5, 0.0, 0.0), 0.0)},
           {"a plane, whole tracks, 24 frames",
            Shallow(untracked(Clip(CameraPath::kArc, 24, 1.0, 0.0, 0.0)), 0.0)},
           {"pure rotation", turning(0.5)},
           {"pure rotation, 10 % wrong, 1 px", Clip(CameraPath::kRotation, 120, 1.0, 0.1, 0.3)},
           {"pure rotation, tracks drift", Drifting(turning(0.3), 0.3)},
           {"static camera", still(0.5)},
           {"static camera, tracks drift", Drifting(still(0.3), 0.3)},
           {"lateral, tracks drift", Drifting(lateral(0.3), 0.3)},
           {"static camera, 10 % wrong, 1 px", Clip(CameraPath::kStatic, 120, 1.0, 0.1, 0.3)}}) {
    for (int seed = 1; seed <= seeds; ++seed) {
      options.seed = static_cast<std::uint64_t>(seed);
      const SyntheticTracks tracks = MakeTracks(options, 300);
      const MapperResult result = ReconstructWithCeres(tracks.file);
      fmt::print("{:<38} seed {}: {:>4} of {} frames, ATE {:>8.3f}, {}\n",
                 name,
                 seed,
                 result.summary.registered,
                 options.frames,
                 Error(result.reconstruction, tracks.cam_from_world),
                 result.summary.termination);
      std::fflush(stdout);
    }
  }
}

void Real() {
  const auto run = [](const std::string& name, const TrackFile& file) {
    const MapperResult result = ReconstructWithCeres(file);
    fmt::print("{:<26} f {:.0f} px, noise {:.2f} px, {} tracks without a point; {}\n",
               name,
               result.reconstruction.camera.fx,
               result.noise,
               result.without_point.size(),
               result.summary.Brief());
  };
  const fs::path lines = test::SharedData("opencv_sfm_tracks");
  const fs::path tables = test::SharedData("cmu_hotel");
  if (!fs::exists(lines) || !fs::exists(tables)) {
    ThrowError("{} is missing: set COHORT_DATA to the data folder", lines.string());
  }
  Camera desktop = Camera::Guess(1280, 720);
  desktop.fx = desktop.fy = 1914;
  desktop.cx = 640;
  desktop.cy = 360;
  desktop.known = true;
  run("desktop", test::ReadTrackLines(lines / "desktop_tracks.txt", desktop));
  run("desktop, unknown camera",
      test::ReadTrackLines(lines / "desktop_tracks.txt", Camera::Guess(1280, 720)));
  run("backyard, unknown camera",
      test::ReadTrackLines(lines / "backyard_tracks.txt", Camera::Guess(800, 450)));
  run("hotel, unknown camera", test::ReadTrackTables(tables, Camera::Guess(512, 480)));
}

}  // namespace
}  // namespace cohort

int main(int argc, char** argv) {
  CLI::App app("The Ceres backend: accuracy and speed against COLMAP, scaling, hard input");
  app.require_subcommand(1);
  cohort::RenderedOptions rendered;
  CLI::App* command = nullptr;
  for (const auto& [name, help, run] :
       {std::tuple("rendered", "tracks of rendered clips", &cohort::Rendered),
        std::tuple("refined", "a second pass on the same tracks", &cohort::Refined)}) {
    command = app.add_subcommand(name, help);
    command->add_option("--work", rendered.work, "folder for clips and tracks, kept")->required();
    command->add_option("--clips", rendered.clips, "SCENE:MOTION ...");
    command->add_option("--levels", rendered.levels, "of `cohort degrade`");
    command->add_option("--tracker", rendered.tracker, "of `cohort track`");
    command->add_option("--frames", rendered.frames, "of a clip");
    command->add_option("--features", rendered.features, "in sight in a frame");
    command->callback([&rendered, run = run] { run(rendered); });
  }

  cohort::SyntheticOptions synthetic;
  command = app.add_subcommand("synthetic", "generated tracks");
  command->add_option("--frames", synthetic.frames, "of a clip");
  command->add_option("--features", synthetic.features, "in sight in a frame");
  command->add_option("--seeds", synthetic.seeds, "of each geometry");
  command->callback([&] { cohort::Synthetic(synthetic); });

  app.add_subcommand("scaling", "250 to 1000 frames")->callback([] { cohort::Scaling(); });

  int seeds = 2;
  command = app.add_subcommand("hard", "hard and impossible input");
  command->add_option("--seeds", seeds, "of each geometry");
  command->callback([&] { cohort::Hard(seeds); });

  app.add_subcommand("real", "real tracks")->callback([] { cohort::Real(); });

  cv::setNumThreads(1);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e);
  } catch (const std::exception& e) {
    fmt::print(stderr, "backend_benchmark: {}\n", e.what());
    return 1;
  }
  return 0;
}
