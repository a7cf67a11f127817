#include "frontend/storage/input_record.h"

#include <mutex>
#include <set>
#include <string>
#include <system_error>

namespace cohort {
namespace {

namespace fs = std::filesystem;

std::mutex mutex;
bool is_on = false;
std::set<std::string> files;
std::multiset<std::string> own;  // entries

std::string TargetOf(const fs::path& path) {
  std::error_code error;
  const fs::path target = fs::canonical(path, error);
  return error ? std::string() : target.string();
}

}  // namespace

std::string EntryOf(const fs::path& path) {
  std::error_code error;  // ignored: opening the file reports the error
  const fs::path folder = fs::weakly_canonical(fs::absolute(path, error).parent_path(), error);
  return (folder / path.filename()).string();
}

InputRecord::InputRecord() {
  const std::lock_guard lock(mutex);
  is_on = true;
  files.clear();
}

InputRecord::~InputRecord() {
  const std::lock_guard lock(mutex);
  is_on = false;
}

void InputRecord::Add(const fs::path& file) {
  const std::lock_guard lock(mutex);
  const std::string entry = EntryOf(file);
  if (!is_on || own.contains(entry)) return;
  files.insert(entry);
  files.insert(TargetOf(file));
}

void InputRecord::Forget(const fs::path& file) {
  const std::lock_guard lock(mutex);
  files.erase(EntryOf(file));
  files.erase(TargetOf(file));
}

bool InputRecord::Holds(const fs::path& path) {
  const std::lock_guard lock(mutex);
  return is_on && fs::path(path).has_filename() && files.contains(EntryOf(path));
}

std::optional<fs::path> InputRecord::FindBelow(const fs::path& folder) {
  const std::lock_guard lock(mutex);
  const std::string itself = TargetOf(folder);
  if (!is_on || itself.empty()) return std::nullopt;
  if (files.contains(itself)) return itself;
  const auto file = files.lower_bound(itself + "/");
  if (file == files.end() || !file->starts_with(itself + "/")) return std::nullopt;
  return *file;
}

OwnFile::OwnFile(const fs::path& file) : entry_(EntryOf(file)) {
  const std::lock_guard lock(mutex);
  own.insert(entry_);
}

OwnFile::~OwnFile() {
  const std::lock_guard lock(mutex);
  own.erase(own.find(entry_));
}

}  // namespace cohort
