#include "frontend/storage/npz.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <zip.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <deque>
#include <fstream>
#include <functional>
#include <limits>
#include <optional>
#include <system_error>

#include "frontend/core/error.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/output.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "NumPy's files are read little-endian");

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr std::string_view kSuffix = ".npy";
constexpr std::size_t kMaxHeaderBytes = 1 << 16;
constexpr std::size_t kMaxDimensions = 64;  // NumPy's
constexpr std::size_t kChunkBytes = 1 << 20;
constexpr zip_uint32_t kDeflateLevel = 6;
constexpr std::uint64_t kMaxDeflateRatio = 1040;  // slightly more than deflate can reach

// ---- the types of NumPy ----

template <typename T>
double Load(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return static_cast<double>(value);
}

// IEEE 754 half precision: 1 sign, 5 exponent, 10 mantissa bits.
double LoadHalf(const char* bytes) {
  std::uint16_t bits = 0;
  std::memcpy(&bits, bytes, sizeof(bits));
  const int exponent = (bits >> 10) & 31;
  const int mantissa = bits & 1023;
  double value = 0.0;
  if (exponent == 31) {
    value = mantissa == 0 ? std::numeric_limits<double>::infinity()
                          : std::numeric_limits<double>::quiet_NaN();
  } else if (exponent == 0) {
    value = std::ldexp(mantissa, -24);
  } else {
    value = std::ldexp(1024 + mantissa, exponent - 25);
  }
  return (bits & 0x8000) != 0 ? -value : value;
}

struct Type {
  std::string_view descr;
  NpzKind kind;
  std::size_t bytes;
  double (*load)(const char*);
};
constexpr std::array<Type, 12> kTypes{{{"|b1", NpzKind::kBool, 1, Load<std::uint8_t>},
                                       {"|i1", NpzKind::kInteger, 1, Load<std::int8_t>},
                                       {"|u1", NpzKind::kInteger, 1, Load<std::uint8_t>},
                                       {"<i2", NpzKind::kInteger, 2, Load<std::int16_t>},
                                       {"<u2", NpzKind::kInteger, 2, Load<std::uint16_t>},
                                       {"<i4", NpzKind::kInteger, 4, Load<std::int32_t>},
                                       {"<u4", NpzKind::kInteger, 4, Load<std::uint32_t>},
                                       {"<i8", NpzKind::kInteger, 8, Load<std::int64_t>},
                                       {"<u8", NpzKind::kInteger, 8, Load<std::uint64_t>},
                                       {"<f2", NpzKind::kReal, 2, LoadHalf},
                                       {"<f4", NpzKind::kReal, 4, Load<float>},
                                       {"<f8", NpzKind::kReal, 8, Load<double>}}};

// ---- the header of a .npy: a Python dictionary of descr, fortran_order and shape ----

struct Header {
  std::string descr;
  bool fortran_order = false;
  std::vector<std::size_t> shape;
};

class HeaderParser {
 public:
  explicit HeaderParser(std::string_view text) : text_(text) {}

  // Returns nullopt if the text is not such a dictionary.
  std::optional<Header> Parse() {
    Header header;
    bool has_descr = false;
    bool has_order = false;
    bool has_shape = false;
    if (!Take("{")) return std::nullopt;
    while (!Take("}")) {
      const auto key = Quoted();
      if (!key || !Take(":")) return std::nullopt;
      if (*key == "descr" && !has_descr) {
        const auto descr = Quoted();
        if (!descr) return std::nullopt;
        header.descr = *descr;
        has_descr = true;
      } else if (*key == "fortran_order" && !has_order) {
        header.fortran_order = Take("True");
        if (!header.fortran_order && !Take("False")) return std::nullopt;
        has_order = true;
      } else if (*key == "shape" && !has_shape) {
        if (!Shape(header.shape)) return std::nullopt;
        has_shape = true;
      } else {
        return std::nullopt;
      }
      if (!Take(",") && !Next("}")) return std::nullopt;
    }
    SkipBlanks();
    if (!text_.empty() || !has_descr || !has_order || !has_shape) return std::nullopt;
    return header;
  }

 private:
  void SkipBlanks() { text_.remove_prefix(std::min(text_.find_first_not_of(" \n"), text_.size())); }
  bool Next(std::string_view token) {
    SkipBlanks();
    return text_.starts_with(token);
  }
  bool Take(std::string_view token) {
    if (!Next(token)) return false;
    text_.remove_prefix(token.size());
    return true;
  }
  std::optional<std::string> Quoted() {
    for (const char* quote : {"'", "\""}) {
      if (!Take(quote)) continue;
      const std::size_t end = text_.find(*quote);
      if (end == std::string_view::npos) return std::nullopt;
      std::string word(text_.substr(0, end));
      text_.remove_prefix(end + 1);
      return word;
    }
    return std::nullopt;
  }
  bool Shape(std::vector<std::size_t>& shape) {
    if (!Take("(")) return false;
    while (!Take(")")) {
      SkipBlanks();
      std::size_t size = 0;
      const auto [end, error] = std::from_chars(text_.data(), text_.data() + text_.size(), size);
      if (error != std::errc()) return false;
      text_.remove_prefix(static_cast<std::size_t>(end - text_.data()));
      if (shape.size() == kMaxDimensions) return false;
      shape.push_back(size);
      if (!Take(",") && !Next(")")) return false;
    }
    return true;
  }

  std::string_view text_;
};

// Returns nullopt if the count exceeds the limit of an array.
std::optional<std::size_t> CountOf(std::span<const std::size_t> shape) {
  std::size_t count = 1;
  for (const std::size_t size : shape) {
    if (size > kMaxNpzValues) return std::nullopt;  // even if another dimension is 0
    if (size > 0 && count > kMaxNpzValues / size) return std::nullopt;
    count *= size;
  }
  return count;
}

// Converts Fortran's order, the first index fastest, to C's.
std::vector<double> FromFortranOrder(const std::vector<double>& values,
                                     std::span<const std::size_t> shape) {
  struct Axis {
    std::size_t size;
    std::size_t stride;  // in `values`
    std::size_t index;
  };
  std::vector<Axis> axes;  // without axes of length 1, which only cost time
  std::size_t stride = 1;
  for (const std::size_t size : shape) {
    if (size != 1) axes.push_back({size, stride, 0});
    stride *= size;
  }
  std::vector<double> result(values.size());
  std::size_t at = 0;
  for (double& value : result) {
    value = values[at];
    for (auto axis = axes.rbegin(); axis != axes.rend(); ++axis) {
      at += axis->stride;
      if (++axis->index < axis->size) break;
      at -= axis->size * axis->stride;
      axis->index = 0;
    }
  }
  return result;
}

// ---- zip ----

struct CloseZip {
  void operator()(zip_t* archive) const { zip_discard(archive); }
};
using Zip = std::unique_ptr<zip_t, CloseZip>;

struct CloseMember {
  void operator()(zip_file_t* member) const { zip_fclose(member); }
};

std::string ZipErrorText(int code) {
  zip_error_t error;
  zip_error_init_with_code(&error, code);
  std::string text = zip_error_strerror(&error);
  zip_error_fini(&error);
  return text;
}

// One NAME.npy, in an archive or as a file of its own, read from its start.
class Member {
 public:
  Member(std::ifstream file, std::string what, std::uint64_t file_bytes)
      : what_(std::move(what)), file_(std::move(file)), bytes_left_(file_bytes) {}
  Member(zip_t* archive, std::string what, const std::string& file, std::uint64_t archive_bytes)
      : what_(std::move(what)) {
    zip_stat_t stat;
    const zip_int64_t index = zip_name_locate(archive, file.c_str(), 0);
    if (index < 0 || zip_stat_index(archive, static_cast<zip_uint64_t>(index), 0, &stat) != 0) {
      Fail(zip_strerror(archive));
    }
    // Checks the claims of a damaged archive before memory is allocated.
    const bool sized = (stat.valid & ZIP_STAT_SIZE) != 0 && (stat.valid & ZIP_STAT_COMP_SIZE) != 0;
    if (!sized || stat.comp_size > archive_bytes || stat.size / kMaxDeflateRatio > stat.comp_size) {
      Fail("it claims more bytes than the file can hold");
    }
    bytes_left_ = stat.size;
    member_.reset(zip_fopen_index(archive, static_cast<zip_uint64_t>(index), 0));
    if (member_ == nullptr) Fail(zip_strerror(archive));
  }

  std::uint64_t bytes_left() const { return bytes_left_; }

  void Read(char* bytes, std::size_t size) {
    if (size > bytes_left_) Fail("it is truncated");
    for (std::size_t at = 0; at < size;) {
      const zip_int64_t n = ReadSome(bytes + at, size - at);
      if (n <= 0) Fail(n < 0 ? zip_file_strerror(member_.get()) : "it is truncated");
      at += static_cast<std::size_t>(n);
    }
    bytes_left_ -= size;
  }
  // Reading to the end also verifies the archive's checksum.
  void ExpectEnd() {
    char byte = 0;
    if (const zip_int64_t n = ReadSome(&byte, 1); n != 0) {
      Fail(n < 0 ? zip_file_strerror(member_.get()) : "it is longer than the archive says");
    }
  }

  [[noreturn]] void Fail(const std::string& why) const { ThrowError("{}: {}", what_, why); }

 private:
  // How many bytes were read; negative: the archive is damaged.
  zip_int64_t ReadSome(char* bytes, std::size_t size) {
    if (member_ != nullptr) return zip_fread(member_.get(), bytes, size);
    file_.read(bytes, static_cast<std::streamsize>(size));
    return file_.gcount();
  }

  std::string what_;
  std::unique_ptr<zip_file_t, CloseMember> member_;
  std::ifstream file_;  // without a member
  std::uint64_t bytes_left_ = 0;
};

Header ReadHeader(Member& member) {
  std::array<char, 12> start{};
  member.Read(start.data(), 8);
  if (std::string_view(start.data(), kMagic.size()) != kMagic)
    member.Fail("it is not a .npy array");
  const int version = static_cast<unsigned char>(start[6]);
  if (version < 1 || version > 3) {
    member.Fail(fmt::format("version {} of .npy is not supported: 1, 2 and 3 are", version));
  }
  std::uint32_t length = 0;
  member.Read(reinterpret_cast<char*>(&length), version == 1 ? 2 : 4);
  if (length > kMaxHeaderBytes) member.Fail("its header is longer than any that NumPy writes");
  std::string text(length, '\0');
  member.Read(text.data(), length);
  if (text.find("'descr': [") != std::string::npos) {
    member.Fail("it is a structured array: save plain arrays");
  }
  const auto header = HeaderParser(text).Parse();
  if (!header) member.Fail("its header is damaged");
  return *header;
}

const Type* FindType(const Header& header) {
  const auto type = std::ranges::find(kTypes, header.descr, &Type::descr);
  return type == kTypes.end() ? nullptr : &*type;
}

const Type& TypeOf(const Header& header, const Member& member) {
  if (const Type* type = FindType(header)) return *type;
  if (header.descr == "|O") {
    member.Fail("it holds Python objects, which are not supported: save arrays of numbers");
  }
  member.Fail(
      fmt::format("its type {} is not supported: save bool, integers or floats of up to 8 bytes",
                  header.descr));
}

}  // namespace

std::string ShapeText(std::span<const std::size_t> shape) {
  return shape.empty() ? "1" : fmt::format("{}", fmt::join(shape, " x "));
}

struct NpzReader::Impl {
  Member Open(const std::string& name) const;

  fs::path path;
  std::uint64_t bytes = 0;
  Zip archive;
  std::vector<std::string> names;
};

NpzReader::NpzReader(const fs::path& path) : impl_(std::make_unique<Impl>()) {
  impl_->path = path;
  CheckInputFile(path);
  std::error_code error;
  impl_->bytes = fs::file_size(path, error);
  if (error) ThrowError("cannot read {}: {}", path.string(), error.message());
  std::string start(kMagic.size(), '\0');
  OpenInputFile(path).read(start.data(), static_cast<std::streamsize>(start.size()));
  if (start == kMagic) {
    impl_->names.emplace_back(kPlainArray);
    return;
  }
  int code = 0;
  impl_->archive.reset(zip_open(path.c_str(), ZIP_RDONLY | ZIP_CHECKCONS, &code));
  if (impl_->archive == nullptr) {
    ThrowError("cannot read {} as .npz: {}", path.string(), ZipErrorText(code));
  }
  const zip_int64_t count = zip_get_num_entries(impl_->archive.get(), 0);
  for (zip_int64_t i = 0; i < count; ++i) {
    const char* file = zip_get_name(impl_->archive.get(), static_cast<zip_uint64_t>(i), 0);
    if (file == nullptr || !std::string_view(file).ends_with(kSuffix)) continue;
    std::string_view name(file);
    name.remove_suffix(kSuffix.size());
    impl_->names.emplace_back(name);
  }
}

NpzReader::NpzReader(NpzReader&&) noexcept = default;
NpzReader::~NpzReader() = default;

const std::vector<std::string>& NpzReader::names() const { return impl_->names; }

bool NpzReader::Has(std::string_view name) const {
  return std::find(impl_->names.begin(), impl_->names.end(), name) != impl_->names.end();
}

Member NpzReader::Impl::Open(const std::string& name) const {
  if (archive == nullptr) return {OpenInputFile(path), path.string(), bytes};
  return {archive.get(),
          fmt::format("{}, array {}", path.string(), name),
          name + std::string(kSuffix),
          bytes};
}

NpzReader::Description NpzReader::Describe(const std::string& name) const {
  Member member = impl_->Open(name);
  const Header header = ReadHeader(member);
  const Type* type = FindType(header);
  return {type == nullptr ? std::nullopt : std::optional(type->kind), header.shape};
}

NpzArray NpzReader::Read(const std::string& name, std::size_t max_values) {
  Member member = impl_->Open(name);
  const Header header = ReadHeader(member);
  const Type& type = TypeOf(header, member);
  const auto count = CountOf(header.shape);
  if (!count || *count > max_values) {
    member.Fail(
        fmt::format("it is {}: {} numbers are the maximum", ShapeText(header.shape), max_values));
  }
  if (*count * type.bytes != member.bytes_left()) {
    member.Fail(fmt::format("its shape {} does not fit its {} bytes of {}",
                            ShapeText(header.shape),
                            member.bytes_left(),
                            header.descr));
  }
  NpzArray array{.kind = type.kind, .shape = header.shape, .values = {}};
  std::vector<char> chunk(kChunkBytes);
  while (member.bytes_left() > 0) {
    const auto size = std::min<std::uint64_t>(chunk.size(), member.bytes_left());
    member.Read(chunk.data(), size);
    for (std::size_t at = 0; at < size; at += type.bytes) {
      array.values.push_back(type.load(chunk.data() + at));
    }
  }
  member.ExpectEnd();
  if (header.fortran_order) array.values = FromFortranOrder(array.values, array.shape);
  return array;
}

// ---- writing ----

namespace {

// One NAME.npy as libzip requests it: its header, then its rows.
class Rows {
 public:
  using Fill = std::function<void(std::size_t row, std::span<std::byte> bytes)>;

  Rows(std::string header, std::size_t rows, std::size_t row_bytes, Fill fill)
      : header_(std::move(header)), rows_(rows), row_(row_bytes), fill_(std::move(fill)) {}

  // The callback for zip_source_function.
  static zip_int64_t Answer(void* self, void* data, zip_uint64_t size, zip_source_cmd_t command) {
    return static_cast<Rows*>(self)->Answer(data, size, command);
  }

 private:
  zip_int64_t Answer(void* data, zip_uint64_t size, zip_source_cmd_t command) {
    switch (command) {
      case ZIP_SOURCE_OPEN:
        next_row_ = 0;
        rest_ = std::as_bytes(std::span(header_));
        return 0;
      case ZIP_SOURCE_READ:
        return static_cast<zip_int64_t>(Read({static_cast<std::byte*>(data), size}));
      case ZIP_SOURCE_STAT: {
        auto* const stat = static_cast<zip_stat_t*>(data);
        zip_stat_init(stat);
        stat->valid = ZIP_STAT_SIZE;
        stat->size = header_.size() + rows_ * row_.size();
        return sizeof(*stat);
      }
      case ZIP_SOURCE_ERROR:
        return zip_error_to_data(&no_error_, data, size);
      case ZIP_SOURCE_CLOSE:
      case ZIP_SOURCE_FREE:
        return 0;
      case ZIP_SOURCE_SUPPORTS:
        return zip_source_make_command_bitmap(ZIP_SOURCE_OPEN,
                                              ZIP_SOURCE_READ,
                                              ZIP_SOURCE_CLOSE,
                                              ZIP_SOURCE_STAT,
                                              ZIP_SOURCE_ERROR,
                                              ZIP_SOURCE_FREE,
                                              -1);
      default:
        return -1;
    }
  }

  // Fills as much of `out` as possible, because the sizes of the chunks affect the packed bytes.
  std::size_t Read(std::span<std::byte> out) {
    std::size_t written = 0;
    while (written < out.size()) {
      if (rest_.empty()) {
        if (next_row_ == rows_) break;
        fill_(next_row_++, row_);
        rest_ = row_;
        continue;
      }
      const std::size_t size = std::min(rest_.size(), out.size() - written);
      std::copy_n(rest_.begin(), size, out.begin() + static_cast<std::ptrdiff_t>(written));
      rest_ = rest_.subspan(size);
      written += size;
    }
    return written;
  }

  std::string header_;
  std::size_t rows_;
  std::vector<std::byte> row_;
  Fill fill_;
  std::size_t next_row_ = 0;
  std::span<const std::byte> rest_;
  zip_error_t no_error_{};
};

}  // namespace

struct NpzWriter::Impl {
  explicit Impl(const fs::path& path) : file(path), path(path) { RemoveLeftovers(); }

  // libzip writes PARTIAL.XXXXXX and then renames it; a killed run leaves that file behind.
  void RemoveLeftovers() const {
    const std::string begin = file.partial().filename().string() + ".";
    std::error_code error;
    std::vector<fs::path> leftovers;
    for (const auto& entry : fs::directory_iterator(fs::absolute(path).parent_path(), error)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with(begin) && name.size() == begin.size() + 6) {
        leftovers.push_back(entry.path());
      }
    }
    for (const fs::path& leftover : leftovers) fs::remove(leftover, error);
  }

  void AddRows(const std::string& name,
               const std::string& descr,
               std::span<const std::size_t> shape,
               std::size_t rows,
               std::size_t row_bytes,
               Rows::Fill fill) {
    std::string tuple;
    for (const std::size_t size : shape) tuple += fmt::format("{}, ", size);
    std::string header =
        fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}", descr, tuple);
    // NumPy ends its header with a line break at a multiple of 64 bytes.
    constexpr std::size_t kPrefix = 10;
    header.append(63 - (kPrefix + header.size()) % 64, ' ');
    header += '\n';
    std::string start(kMagic);
    start += '\1';
    start += '\0';
    const auto length = static_cast<std::uint16_t>(header.size());
    start.append(reinterpret_cast<const char*>(&length), sizeof(length));
    members.emplace_back(start + header, rows, row_bytes, std::move(fill));
    names.push_back(name + std::string(kSuffix));
  }

  template <typename T>
  void AddRows(const std::string& name,
               const std::string& descr,
               std::span<const std::size_t> shape,
               FillRow<T> fill) {
    const std::size_t row_values = CountOf(shape.subspan(1)).value();
    AddRows(name,
            descr,
            shape,
            shape.front(),
            row_values * sizeof(T),
            [fill = std::move(fill), row = std::vector<T>(row_values)](
                std::size_t index, std::span<std::byte> bytes) mutable {
              fill(index, row);
              std::ranges::copy(std::as_bytes(std::span(row)), bytes.begin());
            });
  }

  void AddBytes(const std::string& name,
                const std::string& descr,
                std::span<const std::size_t> shape,
                std::span<const std::byte> data) {
    AddRows(
        name,
        descr,
        shape,
        1,
        data.size(),
        [kept = std::vector<std::byte>(data.begin(), data.end())](
            std::size_t, std::span<std::byte> bytes) { std::ranges::copy(kept, bytes.begin()); });
  }

  OutputFile file;
  fs::path path;
  std::deque<Rows> members;  // the archive points to them until it is closed
  std::vector<std::string> names;
};

NpzWriter::NpzWriter(const fs::path& path) : impl_(std::make_unique<Impl>(path)) {}
NpzWriter::NpzWriter(NpzWriter&&) noexcept = default;
NpzWriter::~NpzWriter() = default;

void NpzWriter::Add(const std::string& name,
                    std::span<const std::size_t> shape,
                    std::span<const double> values) {
  Check(CountOf(shape) == values.size(), "an array has as many values as its shape says");
  impl_->AddBytes(name, "<f8", shape, std::as_bytes(values));
}

void NpzWriter::Add(const std::string& name,
                    std::span<const std::size_t> shape,
                    std::span<const float> values) {
  Check(CountOf(shape) == values.size(), "an array has as many values as its shape says");
  impl_->AddBytes(name, "<f4", shape, std::as_bytes(values));
}

void NpzWriter::Add(const std::string& name,
                    std::span<const std::size_t> shape,
                    std::span<const std::int64_t> values) {
  Check(CountOf(shape) == values.size(), "an array has as many values as its shape says");
  impl_->AddBytes(name, "<i8", shape, std::as_bytes(values));
}

void NpzWriter::AddRows(const std::string& name,
                        std::span<const std::size_t> shape,
                        FillRow<double> fill) {
  impl_->AddRows(name, "<f8", shape, std::move(fill));
}

void NpzWriter::AddRows(const std::string& name,
                        std::span<const std::size_t> shape,
                        FillRow<float> fill) {
  impl_->AddRows(name, "<f4", shape, std::move(fill));
}

void NpzWriter::AddBoolRows(const std::string& name,
                            std::span<const std::size_t> shape,
                            FillRow<std::uint8_t> fill) {
  impl_->AddRows(name, "|b1", shape, std::move(fill));
}

void NpzWriter::AddTexts(const std::string& name, std::span<const std::string> texts) {
  std::size_t width = 1;
  for (const std::string& text : texts) width = std::max(width, text.size());
  std::string bytes;
  for (const std::string& text : texts) {
    bytes += text;
    bytes.append(width - text.size(), '\0');
  }
  const std::size_t shape[] = {texts.size()};
  impl_->AddBytes(name, fmt::format("|S{}", width), shape, std::as_bytes(std::span(bytes)));
}

void NpzWriter::Commit() {
  const auto fail = [&](const char* why) {
    ThrowError("cannot write {}: {}", impl_->path.string(), why);
  };
  int code = 0;
  Zip archive(zip_open(impl_->file.partial().c_str(), ZIP_CREATE | ZIP_TRUNCATE, &code));
  if (archive == nullptr) fail(ZipErrorText(code).c_str());
  for (std::size_t i = 0; i < impl_->members.size(); ++i) {
    zip_source_t* source = zip_source_function(archive.get(), Rows::Answer, &impl_->members[i]);
    if (source == nullptr) fail(zip_strerror(archive.get()));
    const zip_int64_t index =
        zip_file_add(archive.get(), impl_->names[i].c_str(), source, ZIP_FL_ENC_UTF_8);
    if (index < 0) {
      zip_source_free(source);
      fail(zip_strerror(archive.get()));
    }
    // 1980-01-01, the first date that zip supports, so that equal arrays give equal bytes.
    constexpr zip_uint16_t kFirstDay = (1 << 5) | 1;
    zip_file_set_dostime(archive.get(), static_cast<zip_uint64_t>(index), 0, kFirstDay, 0);
    // NumPy's compression level. libzip's default, 9, takes ten times as long on empty cells and
    // saves a twentieth of the size.
    zip_set_file_compression(
        archive.get(), static_cast<zip_uint64_t>(index), ZIP_CM_DEFLATE, kDeflateLevel);
  }
  if (zip_close(archive.get()) != 0) fail(zip_strerror(archive.get()));
  static_cast<void>(archive.release());  // closed
  impl_->file.LockAnew();                // libzip renames its own file to it
  impl_->file.Commit();
}

}  // namespace cohort
