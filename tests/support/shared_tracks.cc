#include "tests/support/shared_tracks.h"

#include <fmt/format.h>

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "frontend/core/error.h"

namespace cohort::test {
namespace {

std::vector<std::vector<double>> ReadRows(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) ThrowError("{}: cannot be read", path.string());
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(file, line);) {
    std::istringstream text(line);
    std::vector<double> row;
    for (double value = 0.0; text >> value;) row.push_back(value);
    if (!row.empty()) rows.push_back(std::move(row));
  }
  return rows;
}

// `at(track, frame)`: none where it is not seen.
template <typename At>
TrackFile MakeFile(std::size_t tracks, std::size_t frames, const Camera& camera, const At& at) {
  TrackFile file;
  file.width_px = camera.width_px;
  file.height_px = camera.height_px;
  file.camera = camera;
  std::vector<Observation> observations;
  for (std::size_t f = 0; f < frames; ++f) {
    const FrameIndex frame{static_cast<std::uint32_t>(f)};
    file.frames.push_back(
        {frame, fmt::format("frame_{:06}.png", f), static_cast<std::int64_t>(f) * 33'333'333});
    for (std::size_t t = 0; t < tracks; ++t) {
      const std::optional<Eigen::Vector2d> xy = at(t, f);
      if (!xy) continue;
      Observation& o = observations.emplace_back();
      o.feature = FeatureId{static_cast<std::uint32_t>(t)};
      o.frame = frame;
      o.xy = *xy;
    }
  }
  file.tracks = TrackSet::Build(std::move(observations));
  return file;
}

}  // namespace

TrackFile ReadTrackLines(const std::filesystem::path& path, const Camera& camera) {
  const auto rows = ReadRows(path);
  std::size_t numbers = 0;
  for (const auto& row : rows) numbers = std::max(numbers, row.size());
  return MakeFile(rows.size(), numbers / 2, camera, [&](std::size_t track, std::size_t frame) {
    const std::vector<double>& row = rows[track];
    std::optional<Eigen::Vector2d> xy;
    if (2 * frame + 1 < row.size() && row[2 * frame] >= 0.0) {
      xy = Eigen::Vector2d(row[2 * frame], row[2 * frame + 1]);
    }
    return xy;
  });
}

TrackFile ReadTrackTables(const std::filesystem::path& folder, const Camera& camera) {
  const auto xs = ReadRows(folder / "Xs.txt");
  const auto ys = ReadRows(folder / "Ys.txt");
  return MakeFile(xs.at(0).size(), xs.size(), camera, [&](std::size_t track, std::size_t frame) {
    return std::optional<Eigen::Vector2d>({xs[frame][track] - 1.0, ys[frame].at(track) - 1.0});
  });
}

}  // namespace cohort::test
