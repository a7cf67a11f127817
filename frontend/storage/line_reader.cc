#include "frontend/storage/line_reader.h"

#include <cerrno>
#include <cstring>

#include "frontend/storage/input_file.h"

namespace cohort {

LineReader::LineReader(const std::filesystem::path& path)
    : path_(path), stream_(OpenInputFile(path)) {}

bool LineReader::Next() {
  stream_.getline(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
  const auto count = static_cast<std::size_t>(stream_.gcount());
  if (stream_.bad()) ThrowError("cannot read {}: {}", path_.string(), std::strerror(errno));
  if (stream_.fail() && count == 0) return false;
  ++number_;
  if (stream_.fail()) Throw("longer than {} characters: this is not a table", buffer_.size() - 1);
  // The count includes the line's end, except at the end of the file.
  line_ = {buffer_.data(), stream_.eof() ? count : count - 1};
  if (line_.ends_with('\r')) line_.remove_suffix(1);
  if (number_ == 1 && line_.starts_with("\xEF\xBB\xBF")) line_.remove_prefix(3);  // byte order mark
  return true;
}

void LineReader::ThrowAt(std::size_t number, const std::string& what) const {
  ThrowError("{}, line {}: {}", path_.string(), number, what);
}

}  // namespace cohort
