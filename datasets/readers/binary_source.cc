#include "datasets/readers/binary_source.h"

#include "frontend/core/error.h"

namespace cohort {

BinarySource::BinarySource(std::istream& in) : in_(in) {
  in_.seekg(0, std::ios::end);
  const auto end = in_.tellg();
  if (in_ && end > 0) size_ = static_cast<std::uint64_t>(end);
}

std::string BinarySource::Bytes(std::uint64_t offset, std::uint64_t count) {
  if (offset > size_ || count > size_ - offset) {
    ThrowError("the file has {} bytes but refers to some beyond them: it is damaged", size_);
  }
  std::string bytes(count, '\0');
  in_.clear();
  in_.seekg(static_cast<std::streamoff>(offset));
  in_.read(bytes.data(), static_cast<std::streamsize>(count));
  if (!in_) ThrowError("the file became shorter while it was read");
  return bytes;
}

std::uint64_t BinarySource::Integer(std::uint64_t offset, int bytes, ByteOrder order) {
  const std::string read = Bytes(offset, static_cast<std::uint64_t>(bytes));
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < read.size(); ++i) {
    const bool big = order == ByteOrder::kBigEndian;
    value = value << 8U | static_cast<unsigned char>(read[big ? i : read.size() - 1 - i]);
  }
  return value;
}

}  // namespace cohort
