// Words of a command line: one a line.
#include "pipelines/console/command_line.h"

#include <cstdio>

#include "datasets/readers/sequence.h"
#include "frontend/geometry/camera_text.h"
#include "frontend/track/tracker_options.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

namespace {

struct Options {
  std::vector<std::string> inputs;
  std::string out;
  TrackerOptions tracker;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.List("inputs", o.inputs, "What is read.", Tier::kCommon);
    v.Text("out", o.out, "What is written.", Tier::kCommon);
    v.Group("tracker", o.tracker, "How to track.");
  }
};

const CommandLine kLine{
    .name = "track",
    .usage = "INPUTS --out F.tracks",
    .summary = "Track features",
    .positionals = {"inputs"},
    .required = {"inputs", "out"},
    .short_flags = {{"window", {"tracker.klt.window_px", "tracker.subspace.template_px"}}}};

}  // namespace

void Run(std::string_view bytes) {
  static const bool kSilent = std::freopen("/dev/null", "w", stdout) != nullptr;
  if (!kSilent) std::abort();
  std::vector<std::string> words;
  for (std::size_t at = 0; at <= bytes.size();) {
    const std::size_t end = std::min(bytes.find('\n', at), bytes.size());
    // A word ends with its first NUL.
    words.emplace_back(bytes.substr(at, end - at).substr(0, bytes.substr(at, end - at).find('\0')));
    at = end + 1;
  }
  Try([&] {
    Options options;
    ParseCommandLine(kLine, ListOptions(options), words);
    ValidateOptions(options.tracker);
  });
  Try([&] { WordsOfCamera(CameraFromWords(words)); });
  for (const std::string& word : words) {
    Try([&] { FrameRange::Parse(word); });
  }
}

}  // namespace cohort::fuzz
