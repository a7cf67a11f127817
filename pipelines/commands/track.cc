#include "pipelines/commands/track.h"

#include "pipelines/console/progress_bar.h"
#include "pipelines/console/table.h"
#include "pipelines/sfm/track_clip.h"

namespace cohort {
namespace {

void PrintFigures(const TrackFigures& figures, const std::string& out) {
  fmt::print(
      "{}",
      AlignedTable(
          {{"tracks", out},
           {"frames", fmt::format("{}", figures.frames)},
           {"tracks", fmt::format("{}", figures.tracks)},
           {"observations", fmt::format("{}", figures.observations)},
           {"of them predicted", fmt::format("{}", figures.predicted)},
           {"mean observed track length", fmt::format("{:.1f}", figures.mean_observed_length)},
           {"decode [ms/frame]", fmt::format("{:.2f}", figures.PerFrame(figures.decode_ms))},
           {"detect [ms/frame]", fmt::format("{:.2f}", figures.PerFrame(figures.detect_ms))},
           {"track [ms/frame]", fmt::format("{:.2f}", figures.PerFrame(figures.track_ms))},
           {"write [ms/frame]", fmt::format("{:.2f}", figures.PerFrame(figures.write_ms))},
           {"second pass [ms/frame]",
            fmt::format("{:.2f}", figures.PerFrame(figures.second_pass_ms))}}));
}

void RunTrack(const TrackClipOptions& options) {
  const TrackFigures figures = TrackClip(options, ConsoleReport());
  PrintFigures(figures, options.out);
}

}  // namespace

Command TrackCommand() {
  return MakeCommand({.name = "track",
                      .usage = "INPUT --out F.tracks [options]",
                      .summary = "Track features through a video",
                      .positionals = {"input"},
                      .required = {"input", "out"},
                      .short_flags = {{"features", {"detector.max_features"}},
                                      {"history", {"subspace.history_length"}},
                                      {"window",
                                       {"klt.window_px", "subspace.template_px"},
                                       "The side of the patch of tracker klt, and of the template "
                                       "of descent and of the joint guide [px], odd. A larger one "
                                       "averages out more noise, but more often covers two "
                                       "surfaces."},
                                      {"constraint", {"subspace.constraint"}},
                                      {"penalty", {"subspace.penalty"}},
                                      {"uncentered", {"subspace.uncentered"}},
                                      {"second-pass", {"second_pass.mode"}}}},
                     RunTrack);
}

}  // namespace cohort
