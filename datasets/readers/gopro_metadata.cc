#include "datasets/readers/gopro_metadata.h"

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "datasets/readers/binary_source.h"
#include "frontend/core/error.h"
#include "frontend/storage/input_file.h"

namespace cohort {
namespace {

// A piece of the file.
struct Span {
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
};

// A file may contain any number of boxes.
constexpr int kMostBoxes = 4096;
constexpr int kMostEntries = 4096;
constexpr int kMostLevels = 8;
constexpr std::uint64_t kMostSettingsBytes = 1 << 20;

// The contents of the first nested boxes of these names (ISO/IEC 14496-12, 4.2): a box is its total
// length, its name and, after a length of 1, the length in 8 bytes; 0 means up to the end.
std::optional<Span> FindBox(BinarySource& source,
                            Span in,
                            std::span<const std::string_view> names,
                            int& boxes) {
  if (names.empty()) return in;
  std::uint64_t at = in.begin;
  while (in.end - at >= 8 && ++boxes <= kMostBoxes) {
    std::uint64_t length = source.Integer(at, 4);
    std::uint64_t header = 8;
    if (length == 1) {
      length = source.Integer(at + 8, 8);
      header = 16;
    } else if (length == 0) {
      length = in.end - at;
    }
    if (length < header || length > in.end - at) return std::nullopt;
    if (source.Bytes(at + 4, 4) == names.front()) {
      const Span inside{at + header, at + length};
      const auto found = FindBox(source, inside, names.subspan(1), boxes);
      if (found) return found;
    }
    at += length;
  }
  return std::nullopt;
}

struct Settings {
  std::optional<double> diagonal_deg;
  std::optional<char> mode;
};

// Reads entries: a key of four letters, a type, the size of a value and the number of values, then
// the values, padded to a multiple of four bytes. Type 0 contains entries itself.
void ReadEntries(BinarySource& source, Span in, int level, int& entries, Settings& settings) {
  std::uint64_t at = in.begin;
  while (in.end - at >= 8 && ++entries <= kMostEntries) {
    const std::string key = source.Bytes(at, 4);
    const std::uint64_t type = source.Integer(at + 4, 1);
    const std::uint64_t length = source.Integer(at + 5, 1) * source.Integer(at + 6, 2);
    const Span value{at + 8, at + 8 + length};
    if (length > in.end - value.begin) return;
    if (type == 0 && level < kMostLevels) ReadEntries(source, value, level + 1, entries, settings);
    if (key == "ZFOV" && type == 'f' && length >= 4) {
      settings.diagonal_deg =
          std::bit_cast<float>(static_cast<std::uint32_t>(source.Integer(value.begin, 4)));
    }
    if (key == "VFOV" && type == 'c' && length >= 1) {
      settings.mode = source.Bytes(value.begin, 1)[0];
    }
    const std::uint64_t filled = (length + 3) / 4 * 4;
    if (filled > in.end - value.begin) return;
    at = value.begin + filled;
  }
}

}  // namespace

std::optional<GoProView> ReadGoProView(const std::filesystem::path& video) {
  try {
    std::ifstream in = OpenInputFile(video);
    BinarySource source(in);
    constexpr std::array<std::string_view, 3> kPlace{"moov", "udta", "GPMF"};
    int boxes = 0;
    const auto place = FindBox(source, {0, source.size()}, kPlace, boxes);
    if (!place || place->end - place->begin > kMostSettingsBytes) return std::nullopt;
    Settings settings;
    int entries = 0;
    ReadEntries(source, *place, 0, entries, settings);
    if (!settings.diagonal_deg) return std::nullopt;
    return GoProView{.diagonal_deg = *settings.diagonal_deg, .mode = settings.mode};
  } catch (const Error&) {  // truncated or damaged: reading its frames reports it
    return std::nullopt;
  }
}

}  // namespace cohort
