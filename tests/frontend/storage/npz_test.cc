// Files of the real NumPy, and files for it.

#include "frontend/storage/npz.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/storage/output.h"
#include "tests/support/numpy.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using test::RunNumpy;
using test::TempDir;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(Npz, ReadsEveryTypeAndOrderThatNumpySaves) {
  const TempDir dir;
  for (const char* save : {"np.savez", "np.savez_compressed"}) {
    RunNumpy(dir.path(),
             std::string(save) +
                 "('a.npz', bool=np.array([[True, False]]), i1=np.int8([-1]), u1=np.uint8([200]),"
                 " i2=np.int16([-3]), u2=np.uint16([65535]), i4=np.int32([-5]),"
                 " u4=np.uint32([4294967295]), i8=np.int64([-7]), u8=np.uint64([7]),"
                 " f2=np.float16([0.1, -2, 6e-8, np.inf, np.nan]), f4=np.float32([0.1]),"
                 " f8=np.float64([0.1]), number=np.float64(3), none=np.zeros((0, 2)),"
                 " rows=np.arange(6.0).reshape(2, 3),"
                 " columns=np.asfortranarray(np.arange(24.0).reshape(2, 1, 3, 4, 1)))");
    NpzReader npz(dir / "a.npz");
    EXPECT_EQ(npz.names().size(), 16u);
    EXPECT_TRUE(npz.Has("f2"));
    EXPECT_FALSE(npz.Has("f16"));
    EXPECT_EQ(npz.Read("bool").kind, NpzKind::kBool);
    EXPECT_THAT(npz.Read("bool").values, ElementsAre(1.0, 0.0));
    EXPECT_THAT(npz.Read("bool").shape, ElementsAre(1u, 2u));
    const std::pair<const char*, double> integers[] = {{"i1", -1.0},
                                                       {"u1", 200.0},
                                                       {"i2", -3.0},
                                                       {"u2", 65535.0},
                                                       {"i4", -5.0},
                                                       {"u4", 4294967295.0},
                                                       {"i8", -7.0},
                                                       {"u8", 7.0}};
    for (const auto& [name, value] : integers) {
      EXPECT_EQ(npz.Read(name).kind, NpzKind::kInteger);
      EXPECT_THAT(npz.Read(name).values, ElementsAre(value)) << name;
    }
    EXPECT_THAT(npz.Read("f2").values,
                ElementsAre(0.0999755859375,
                            -2.0,
                            5.9604644775390625e-8,
                            std::numeric_limits<double>::infinity(),
                            testing::IsNan()));
    EXPECT_THAT(npz.Read("f4").values, ElementsAre(double{0.1F}));
    EXPECT_THAT(npz.Read("f8").values, ElementsAre(0.1));
    EXPECT_THAT(npz.Read("number").shape, ElementsAre());
    EXPECT_THAT(npz.Read("number").values, ElementsAre(3.0));
    EXPECT_THAT(npz.Read("none").values, ElementsAre());
    EXPECT_THAT(npz.Read("rows").values, ElementsAre(0, 1, 2, 3, 4, 5));
    const NpzArray columns = npz.Read("columns");
    EXPECT_THAT(columns.shape, ElementsAre(2u, 1u, 3u, 4u, 1u));
    for (std::size_t i = 0; i < 24; ++i) EXPECT_EQ(columns.values[i], static_cast<double>(i));
  }
}

TEST(Npz, NumpyReadsWhatIsWritten) {
  const TempDir dir;
  const auto write = [&](const char* name) {
    NpzWriter npz(dir / name);
    const std::size_t shape[] = {2, 3};
    const std::vector<double> reals{0.1, -1.0, 5e-324, 1e308, 0.0, 3.0};
    const std::vector<float> floats{1, 2, 3, 4, 5, 6};
    const std::vector<std::int64_t> integers{-1, std::int64_t{1} << 62};
    npz.Add("reals", shape, std::span<const double>(reals));
    npz.Add("floats", shape, std::span<const float>(floats));
    npz.AddRows("rows", shape, [](std::size_t row, std::span<double> values) {
      std::ranges::fill(values, 0.5 + static_cast<double>(row));
    });
    // Larger than what libzip asks for at a time.
    const std::size_t large[] = {3, 5000, 2};
    npz.AddRows("large", large, [](std::size_t row, std::span<float> values) {
      for (std::size_t i = 0; i < values.size(); ++i) {
        values[i] = static_cast<float>(row * values.size() + i);
      }
    });
    const std::size_t none[] = {2, 0};
    npz.AddBoolRows("none", none, [](std::size_t, std::span<std::uint8_t>) {});
    npz.Add("integers", std::span(shape).first(1), std::span<const std::int64_t>(integers));
    npz.AddBoolRows(
        "bools", std::span(shape).first(1), [](std::size_t row, std::span<std::uint8_t> values) {
          values[0] = row == 0 ? 1 : 0;
        });
    npz.AddTexts("texts", std::vector<std::string>{"a", "b/\xC3\xA9.png", ""});
    npz.Commit();
  };
  write("a.npz");
  EXPECT_EQ(RunNumpy(dir.path(),
                     "z = np.load('a.npz')\n"
                     "print(z['reals'].tolist(), z['reals'].dtype)\n"
                     "print(z['floats'].tolist(), z['floats'].dtype)\n"
                     "print(z['integers'].tolist(), z['bools'].tolist(), z['bools'].dtype)\n"
                     "print(z['rows'].tolist(), z['large'].dtype, z['large'].shape)\n"
                     "print((z['large'].ravel() == np.arange(30000)).all(), z['none'].shape)\n"
                     "print(ascii([text.decode() for text in z['texts']]))"),
            "[[0.1, -1.0, 5e-324], [1e+308, 0.0, 3.0]] float64\n"
            "[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]] float32\n"
            "[-1, 4611686018427387904] [True, False] bool\n"
            "[[0.5, 0.5, 0.5], [1.5, 1.5, 1.5]] float32 (3, 5000, 2)\n"
            "True (2, 0)\n"
            "['a', 'b/\\xe9.png', '']\n");
  write("b.npz");
  EXPECT_EQ(ReadBytes(dir / "a.npz"), ReadBytes(dir / "b.npz"));
}

TEST(Npz, RefusesWhatIsNoArrayOfNumbersInOneLine) {
  const TempDir dir;
  RunNumpy(dir.path(),
           "np.savez('a.npz', objects=np.array([{}, 1], dtype=object), text=np.array(['x']),"
           " big=np.array([1.0], dtype='>f8'), complex=np.array([1j]),"
           " record=np.zeros(2, dtype=[('x', 'f8')]))");
  NpzReader npz(dir / "a.npz");
  const auto fails = [&](const char* name, const char* why) {
    EXPECT_THAT([&] { npz.Read(name); },
                ThrowsMessage<Error>(AllOf(HasSubstr("a.npz"), HasSubstr(name), HasSubstr(why))));
  };
  fails("objects", "Python objects");
  fails("text", "type <U1 is not supported");
  fails("big", "type >f8 is not supported");
  fails("complex", "type <c16 is not supported");
  fails("record", "structured");
}

// Replaces a text in a file by another of the same length.
void Forge(const std::filesystem::path& path, const std::string& from, const std::string& to) {
  std::string bytes = ReadBytes(path);
  const std::size_t at = bytes.find(from);
  ASSERT_NE(at, std::string::npos) << from;
  ASSERT_EQ(from.size(), to.size());
  WriteBytes(path, bytes.replace(at, from.size(), to));
}

TEST(Npz, TrustsNoCount) {
  const TempDir dir;
  const auto dictionary = [](const std::string& shape) {
    return "{'descr': '<f8', 'fortran_order': False, 'shape': (" + shape + "), }\\n";
  };
  const std::string misfit = "does not fit its 16 bytes";
  const std::string too_many = "numbers are the maximum";
  const std::string damaged = "header is damaged";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {dictionary("2,"), ""},
      {dictionary("3,"), misfit},
      {dictionary("1,"), misfit},
      {dictionary("1152921504606846976, 1152921504606846976, 256"), too_many},
      {dictionary("2305843009213693953,"), too_many},
      {dictionary("-2,"), damaged},
      {dictionary("99999999999999999999,"), damaged},
      {"{'descr': '<f8', 'shape': (2,), }\\n", damaged},
      {"{'descr': '<f8', 'fortran_order': False, 'shape': (2,)", damaged},
      {"", damaged}};
  // The header and 16 bytes of data, by hand.
  std::string script = "import zipfile, struct\n";
  for (std::size_t i = 0; i < cases.size(); ++i) {
    script += fmt::format(
        "header = b\"{}\"\n"
        "with zipfile.ZipFile('{}.npz', 'w', zipfile.ZIP_DEFLATED) as z:\n"
        "  z.writestr('a.npy', b'\\x93NUMPY\\x01\\x00' + struct.pack('<H', len(header)) +\n"
        "             header + bytes(16))\n",
        cases[i].first,
        i);
  }
  RunNumpy(dir.path(), script);
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto read = [&] { NpzReader(dir / (std::to_string(i) + ".npz")).Read("a"); };
    if (cases[i].second.empty()) {
      EXPECT_NO_THROW(read());
    } else {
      EXPECT_THAT(read, ThrowsMessage<Error>(HasSubstr(cases[i].second))) << cases[i].first;
    }
  }
}

TEST(Npz, HasNoMoreDimensionsThanNumpy) {
  const TempDir dir;
  RunNumpy(
      dir.path(),
      "import zipfile, struct\n"
      "for n in (64, 65):\n"
      "  header = b\"{'descr': '<f8', 'fortran_order': True, 'shape': (\" + b'1,' * n + b')}'\n"
      "  with zipfile.ZipFile(f'{n}.npz', 'w') as z:\n"
      "    z.writestr('a.npy', b'\\x93NUMPY\\x01\\x00' + struct.pack('<H', len(header)) +\n"
      "               header + bytes(8))\n");
  EXPECT_EQ(NpzReader(dir / "64.npz").Read("a").shape.size(), 64u);
  EXPECT_THAT([&] { NpzReader(dir / "65.npz").Read("a"); },
              ThrowsMessage<Error>(HasSubstr("header is damaged")));
}

TEST(Npz, ADamagedFileIsOneErrorThatNamesIt) {
  const TempDir dir;
  const auto read = [&](const char* name) {
    return [path = dir / name] { NpzReader(path).Read("a"); };
  };
  RunNumpy(dir.path(),
           "np.savez('stored.npz', a=np.arange(1000.0))\n"
           "np.savez_compressed('deflated.npz', a=np.arange(1000.0))\n"
           "import zipfile\n"
           "with zipfile.ZipFile('bytes.npz', 'w') as z: z.writestr('a.npy', b'no array at all')\n"
           "with zipfile.ZipFile('empty.npz', 'w') as z: z.writestr('a.npy', b'')");
  for (const char* name : {"stored.npz", "deflated.npz"}) {
    const std::string whole = ReadBytes(dir / name);
    for (const double share : {0.0, 0.3, 0.7, 0.99}) {
      WriteBytes(dir / "cut.npz", whole.substr(0, static_cast<std::size_t>(share * whole.size())));
      EXPECT_THAT(read("cut.npz"), ThrowsMessage<Error>(HasSubstr("cut.npz"))) << name << share;
    }
    // A byte of the data: the check sum tells.
    std::string wrong = whole;
    wrong[wrong.size() / 2] = static_cast<char>(wrong[wrong.size() / 2] ^ 0x55);
    WriteBytes(dir / "wrong.npz", wrong);
    EXPECT_THAT(read("wrong.npz"), ThrowsMessage<Error>(HasSubstr("wrong.npz"))) << name;
  }
  EXPECT_THAT(read("bytes.npz"), ThrowsMessage<Error>(HasSubstr("not a .npy array")));
  EXPECT_THAT(read("empty.npz"), ThrowsMessage<Error>(HasSubstr("truncated")));
  EXPECT_THAT(read("missing.npz"), ThrowsMessage<Error>(HasSubstr("missing.npz")));
  Forge(dir / "stored.npz", "'<f8'", "'<f9'");
  EXPECT_THAT(read("stored.npz"), ThrowsMessage<Error>(HasSubstr("stored.npz")));
}

TEST(Npz, AnOldFileStaysUntilTheNewOneIsWhole) {
  const TempDir dir;
  WriteBytes(dir / "a.npz", "old");
  WriteBytes(dir / "a.npz.partial.Xy12Zz", "what libzip had of a run that was killed");
  WriteBytes(dir / "a.npz.partial.notes.txt", "is not of its kind");
  { const NpzWriter npz(dir / "a.npz"); }
  EXPECT_FALSE(std::filesystem::exists(dir / "a.npz.partial.Xy12Zz"));
  EXPECT_TRUE(std::filesystem::exists(dir / "a.npz.partial.notes.txt"));
  EXPECT_EQ(ReadBytes(dir / "a.npz"), "old");
  EXPECT_THAT([&] { NpzWriter(dir / "no/a.npz"); }, ThrowsMessage<Error>(HasSubstr("no/a.npz")));
}

}  // namespace
}  // namespace cohort
