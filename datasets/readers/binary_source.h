#pragma once

#include <cstdint>
#include <istream>
#include <string>

namespace cohort {

enum class ByteOrder : std::uint8_t { kLittleEndian, kBigEndian };

// A binary file from others, read at the offsets that it states; nothing outside the file is read,
// whatever it states. The stream must outlive this.
class BinarySource {
 public:
  explicit BinarySource(std::istream& in);

  std::uint64_t size() const { return size_; }
  // Throws Error if the source does not have `count` bytes from `offset` on.
  std::string Bytes(std::uint64_t offset, std::uint64_t count);
  // An unsigned integer of up to 8 bytes. Throws like Bytes.
  std::uint64_t Integer(std::uint64_t offset, int bytes, ByteOrder order = ByteOrder::kBigEndian);

 private:
  std::istream& in_;
  std::uint64_t size_ = 0;
};

}  // namespace cohort
