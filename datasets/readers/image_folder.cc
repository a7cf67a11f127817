#include "datasets/readers/image_folder.h"

#include <glob.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <system_error>

#include "frontend/core/error.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 13> kImageEndings{".png",
                                                         ".jpg",
                                                         ".jpeg",
                                                         ".bmp",
                                                         ".tif",
                                                         ".tiff",
                                                         ".pgm",
                                                         ".ppm",
                                                         ".pnm",
                                                         ".pbm",
                                                         ".webp",
                                                         ".jp2",
                                                         ".ras"};
constexpr std::int64_t kFramesPerSecond = 30;

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// The folder before the first component with a wildcard.
fs::path GlobRoot(const fs::path& pattern) {
  fs::path root;
  for (const fs::path& component : pattern) {
    if (IsGlob(component.string())) break;
    root /= component;
  }
  return root.empty() ? fs::path(".") : root;
}

// Bounds the number of names, of which {a,b}{c,d} has four, because glob would list them all.
void CheckBraces(const std::string& pattern) {
  constexpr double kMost = 10'000.0;
  double count = 1.0;
  double choices = 1.0;
  for (const char c : pattern) {
    if (c == '{') choices = 1.0;
    if (c == ',') ++choices;
    if (c == '}') count *= choices;
  }
  if (count > kMost) {
    ThrowError("{}: its braces expand to more than {:.0f} names", OneLine(pattern), kMost);
  }
}

std::vector<std::string> GlobNames(const fs::path& pattern, const fs::path& root) {
  CheckBraces(pattern.string());
  glob_t found{};
  std::vector<std::string> names;
  if (::glob(pattern.c_str(), GLOB_BRACE, nullptr, &found) == 0) {
    for (std::size_t i = 0; i < found.gl_pathc; ++i) {
      const fs::path file = found.gl_pathv[i];
      if (IsImageFile(file)) names.push_back(file.lexically_relative(root).generic_string());
    }
  }
  ::globfree(&found);
  return names;
}

}  // namespace

bool IsGlob(std::string_view text) { return text.find_first_of("*?[{") != std::string_view::npos; }

bool IsImageFile(const fs::path& file) {
  std::string ending = file.extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return std::ranges::find(kImageEndings, ending) != kImageEndings.end();
}

bool NaturalLess(std::string_view a, std::string_view b) {
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.size() && j < b.size()) {
    if (!IsDigit(a[i]) || !IsDigit(b[j])) {
      if (a[i] != b[j]) return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[j]);
      ++i;
      ++j;
      continue;
    }
    while (i < a.size() && a[i] == '0') ++i;
    while (j < b.size() && b[j] == '0') ++j;
    const std::size_t a_begin = i;
    const std::size_t b_begin = j;
    while (i < a.size() && IsDigit(a[i])) ++i;
    while (j < b.size() && IsDigit(b[j])) ++j;
    if (i - a_begin != j - b_begin) return i - a_begin < j - b_begin;
    const int order = a.substr(a_begin, i - a_begin).compare(b.substr(b_begin, j - b_begin));
    if (order != 0) return order < 0;
  }
  if ((i < a.size()) != (j < b.size())) return j < b.size();
  return a < b;  // equal except for leading zeros
}

std::vector<std::string> ImageNames(const fs::path& folder) {
  std::error_code error;
  std::vector<std::string> names;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (IsImageFile(name) && name.front() != '.' && !entry->is_directory(error))
      names.push_back(name);
  }
  if (error) ThrowError("cannot read folder {}: {}", folder.string(), error.message());
  std::ranges::sort(names, NaturalLess);
  return names;
}

ImageList ListImageFolder(const fs::path& input) {
  ImageList list;
  std::vector<std::string> names;
  if (fs::is_directory(input)) {
    list.root = input;
    names = ImageNames(input);
  } else if (fs::exists(input)) {
    list.root = input.has_parent_path() ? input.parent_path() : fs::path(".");
    names.push_back(input.filename().string());
  } else {
    list.root = GlobRoot(input);
    names = GlobNames(input, list.root);
    if (names.empty()) {
      ThrowError(
          "no file is named {}, and no images match it: searched for png, jpg, tif, pgm, bmp, webp "
          "and the like",
          input.string());
    }
    std::ranges::sort(names, NaturalLess);
    // Removes names that several of its braces match.
    names.erase(std::unique(names.begin(), names.end()), names.end());
  }
  if (names.empty())
    ThrowError("no images in {}: searched for png, jpg, tif, pgm, bmp, webp and the like",
               input.string());

  list.name = FolderName(list.root);
  for (std::size_t i = 0; i < names.size(); ++i) {
    list.images.push_back(
        {std::move(names[i]), static_cast<std::int64_t>(i) * 1'000'000'000 / kFramesPerSecond});
  }
  return list;
}

}  // namespace cohort
