#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace cohort {

// NumPy's .npz, as np.savez and np.savez_compressed write it: a zip archive of arrays NAME.npy.

enum class NpzKind { kBool, kInteger, kReal };

inline constexpr std::string_view kPlainArray = "tracks";           // of a .npy, which has no name
inline constexpr std::size_t kMaxNpzValues = std::size_t{1} << 30;  // per array: 8 GB in memory

struct NpzArray {
  NpzKind kind = NpzKind::kReal;
  std::vector<std::size_t> shape;
  std::vector<double> values;  // C order, the last index runs fastest; bool 0 or 1
};

// "30 x 1000 x 2"; "1" for a single number.
std::string ShapeText(std::span<const std::size_t> shape);

// Reads .npz, or one .npy, as np.save writes it: an array named kPlainArray. Reads arrays of bool,
// integers and floats of 2 to 8 bytes, little-endian, in C or Fortran order. Never trusts the sizes
// that a file states, and never unpickles. Throws Error naming path and array.
class NpzReader {
 public:
  explicit NpzReader(const std::filesystem::path& path);
  NpzReader(NpzReader&&) noexcept;
  ~NpzReader();

  // The names of all arrays, in the file's order. Entries of the archive that are not .npy are not
  // listed.
  const std::vector<std::string>& names() const;
  bool Has(std::string_view name) const;
  // Read from its header alone; the kind is unset if the type is not supported.
  struct Description {
    std::optional<NpzKind> kind;
    std::vector<std::size_t> shape;
  };
  Description Describe(const std::string& name) const;
  // Throws Error if there are more than `max_values` numbers, before allocating memory for them.
  NpzArray Read(const std::string& name, std::size_t max_values = kMaxNpzValues);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Writes compressed arrays, whole or not at all; equal arrays give equal bytes.
//
//   NpzWriter npz("a.npz");
//   npz.Add("xy", {n, 2}, std::span<const double>(values));
//   npz.Commit();
class NpzWriter {
 public:
  explicit NpzWriter(const std::filesystem::path& path);
  NpzWriter(NpzWriter&&) noexcept;
  ~NpzWriter();

  void Add(const std::string& name, std::span<const std::size_t> shape, std::span<const double>);
  void Add(const std::string& name, std::span<const std::size_t> shape, std::span<const float>);
  void Add(const std::string& name,
           std::span<const std::size_t> shape,
           std::span<const std::int64_t>);
  // An array that is never held whole: Commit calls `fill` for each index of the first axis, in
  // order. `fill` must not throw.
  template <typename T>  // double, float, std::uint8_t (as NumPy's bool)
  using FillRow = std::function<void(std::size_t row, std::span<T> values)>;
  void AddRows(const std::string& name, std::span<const std::size_t> shape, FillRow<double> fill);
  void AddRows(const std::string& name, std::span<const std::size_t> shape, FillRow<float> fill);
  void AddBoolRows(const std::string& name,
                   std::span<const std::size_t> shape,
                   FillRow<std::uint8_t> fill);
  // Texts as NumPy's bytes (dtype S): np.char.decode makes them str.
  void AddTexts(const std::string& name, std::span<const std::string> texts);
  void Commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cohort
