// Options as JSON (--config).
#include <nlohmann/json.hpp>

#include "frontend/track/tracker_options.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

namespace {

// A flag, choices, numbers, texts and groups: those of the trackers.
template <typename Options>
void SetAll(const std::filesystem::path& path) {
  Try([&] {
    Options options;
    SetFromJson(ListOptions(options), ReadJsonFile(path), path.string());
    ValidateOptions(options);
    ToJson(options);
  });
}

}  // namespace

void Run(std::string_view bytes) { SetAll<TrackerOptions>(File("config.json", bytes)); }

}  // namespace cohort::fuzz
