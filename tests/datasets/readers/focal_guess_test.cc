#include "datasets/readers/focal_guess.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <string>
#include <utility>
#include <vector>

#include "datasets/open_sequence.h"
#include "datasets/readers/exif.h"
#include "datasets/readers/gopro_metadata.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/output.h"
#include "tests/datasets/fixtures.h"
#include "tests/support/shell.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using std::string_literals::operator""s;
using test::TempDir;
using testing::HasSubstr;

constexpr std::uint16_t kFocalLengthTag = 0x920A;
constexpr std::uint16_t kPixelXTag = 0xA002;
constexpr std::uint16_t kPlaneResolutionTag = 0xA20E;
constexpr std::uint16_t kPlaneUnitTag = 0xA210;
constexpr std::uint16_t kIn35mmTag = 0xA405;
constexpr double kFilmDiagonalMm = 43.2666;

std::string BigEndian(std::uint64_t value, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i) & 0xFFU);
  return text;
}

// What cameras write: a directory that names another one, which has the values.
class Tiff {
 public:
  explicit Tiff(bool little_endian = false) : little_endian_(little_endian) {}

  Tiff& Short(std::uint16_t tag, std::uint16_t value) {
    entries_ += Number(tag, 2) + Number(3, 2) + Number(1, 4) + Number(value, 2) + "\0\0"s;
    return *this;
  }
  Tiff& Rational(std::uint16_t tag, std::uint32_t numerator, std::uint32_t denominator) {
    rationals_.emplace_back(entries_.size() + 8, std::pair(numerator, denominator));
    entries_ += Number(tag, 2) + Number(5, 2) + Number(1, 4) + Number(0, 4);
    return *this;
  }

  std::string Bytes() const {
    constexpr std::uint32_t kDirectory = 8;
    constexpr std::uint32_t kExif = kDirectory + 2 + 12 + 4;
    std::string bytes = little_endian_ ? "II*\0"s : "MM\0*"s;
    bytes += Number(kDirectory, 4) + Number(1, 2);
    bytes += Number(0x8769, 2) + Number(4, 2) + Number(1, 4) + Number(kExif, 4) + Number(0, 4);
    bytes += Number(static_cast<std::uint32_t>(entries_.size() / 12), 2) + entries_ + Number(0, 4);
    for (const auto& [place, value] : rationals_) {
      const auto at = static_cast<std::uint32_t>(bytes.size());
      bytes.replace(kExif + 2 + place, 4, Number(at, 4));
      bytes += Number(value.first, 4) + Number(value.second, 4);
    }
    return bytes;
  }

 private:
  std::string Number(std::uint32_t value, int bytes) const {
    std::string text = BigEndian(value, bytes);
    if (little_endian_) text.assign(text.rbegin(), text.rend());
    return text;
  }

  bool little_endian_;
  std::string entries_;
  std::vector<std::pair<std::size_t, std::pair<std::uint32_t, std::uint32_t>>> rationals_;
};

std::string Encoded(const char* ending, cv::Size size) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(ending, cv::Mat(size, CV_8UC1, cv::Scalar(90)), bytes);
  return {bytes.begin(), bytes.end()};
}

std::string Jpeg(const std::string& tiff, cv::Size size = {300, 200}) {
  std::string bytes = Encoded(".jpg", size);
  bytes.insert(2, "\xFF\xE1"s + BigEndian(8 + tiff.size(), 2) + "Exif\0\0"s + tiff);
  return bytes;
}

std::uint32_t Checksum(const std::string& bytes) {
  std::uint32_t crc = 0xFFFFFFFF;
  for (const char c : bytes) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1U ^ ((crc & 1U) != 0 ? 0xEDB88320U : 0U);
  }
  return ~crc;
}

std::string Png(const std::string& tiff, cv::Size size = {300, 200}) {
  constexpr std::size_t kAfterHeader = 8 + 25;
  const std::string chunk = "eXIf" + tiff;
  std::string bytes = Encoded(".png", size);
  bytes.insert(kAfterHeader, BigEndian(tiff.size(), 4) + chunk + BigEndian(Checksum(chunk), 4));
  return bytes;
}

TEST(Exif, SaysTheFocalLengthInEveryKindOfPicture) {
  const TempDir dir;
  for (const bool little_endian : {false, true}) {
    const std::string tiff = Tiff(little_endian)
                                 .Rational(kFocalLengthTag, 425, 100)
                                 .Short(kPixelXTag, 4000)
                                 .Rational(kPlaneResolutionTag, 25400, 10)
                                 .Short(kPlaneUnitTag, 2)
                                 .Short(kIn35mmTag, 26)
                                 .Bytes();
    for (const auto& [name, bytes] : {std::pair("a.jpg"s, Jpeg(tiff)),
                                      std::pair("a.png"s, Png(tiff)),
                                      std::pair("a.tif"s, tiff)}) {
      WriteBytes(dir / name, bytes);
      const ExifFocal focal = ReadExifFocal(dir / name);
      EXPECT_EQ(focal.in_35mm_film_mm, 26.0) << name;
      EXPECT_EQ(focal.mm, 4.25) << name;
      EXPECT_NEAR(focal.pixels_per_mm.value_or(0.0), 100.0, 1e-12) << name;
      EXPECT_EQ(focal.long_side_px, 4000.0) << name;
    }
  }
}

TEST(Exif, TakesUnknownAndImpossibleValuesForNone) {
  const TempDir dir;
  const auto read = [&dir](const Tiff& tiff) {
    WriteBytes(dir / "a.jpg", Jpeg(tiff.Bytes()));
    return ReadExifFocal(dir / "a.jpg");
  };
  const ExifFocal none = read(
      Tiff().Short(kIn35mmTag, 0).Rational(kFocalLengthTag, 5, 0).Rational(kPlaneUnitTag, 0, 1));
  EXPECT_FALSE(none.in_35mm_film_mm);
  EXPECT_FALSE(none.mm);
  EXPECT_FALSE(none.pixels_per_mm);
  EXPECT_FALSE(none.long_side_px);
  EXPECT_FALSE(FocalGuessOfPictures(dir / "a.jpg", dir / "a.jpg", {300, 200}));
  EXPECT_FALSE(ReadExifFocal(dir / "missing.jpg").mm);
}

void ExpectNoNonsense(const fs::path& file) {
  const ExifFocal focal = ReadExifFocal(file);
  for (const auto& value :
       {focal.in_35mm_film_mm, focal.mm, focal.pixels_per_mm, focal.long_side_px}) {
    if (!value) continue;
    EXPECT_TRUE(std::isfinite(*value));
    EXPECT_GT(*value, 0.0);
  }
  const auto guess = FocalGuessOfPictures(file, file, {300, 200});
  if (!guess) return;
  EXPECT_TRUE(std::isfinite(guess->focal_px));
  EXPECT_GT(guess->focal_px, 0.0);
}

TEST(Exif, NothingThatIsDamagedIsReadBeyondTheFile) {
  const TempDir dir;
  const std::string tiff = Tiff()
                               .Rational(kFocalLengthTag, 425, 100)
                               .Rational(kPlaneResolutionTag, 25400, 10)
                               .Short(kIn35mmTag, 26)
                               .Bytes();
  for (const std::string& whole : {Jpeg(tiff), Png(tiff), tiff}) {
    const std::size_t bytes = std::min<std::size_t>(whole.size(), 200);
    for (std::size_t i = 0; i < bytes; ++i) {
      WriteBytes(dir / "cut", whole.substr(0, i));
      ExpectNoNonsense(dir / "cut");
      for (const char value : {'\0', '\x01', '\x7F', '\xFF'}) {
        std::string changed = whole;
        changed[i] = value;
        WriteBytes(dir / "changed", changed);
        ExpectNoNonsense(dir / "changed");
      }
    }
  }
  // A directory that names itself, and one of 65535 entries.
  WriteBytes(dir / "circle", "MM\0*\0\0\0\x08\0\x01\x87\x69\0\x04\0\0\0\x01\0\0\0\x08\0\0\0\0"s);
  ExpectNoNonsense(dir / "circle");
  WriteBytes(dir / "many", "MM\0*\0\0\0\x08\xFF\xFF"s + std::string(100'000, '\x01'));
  ExpectNoNonsense(dir / "many");
}

TEST(FocalGuess, ComparesDiagonalsWith35mmFilm) {
  const TempDir dir;
  WriteBytes(dir / "a.jpg", Jpeg(Tiff().Short(kIn35mmTag, 26).Bytes()));
  const auto guess_of = [&dir](int width_px, int height_px) {
    return FocalGuessOfPictures(dir / "a.jpg", dir / "a.jpg", {width_px, height_px}).value();
  };
  // Of the film's own shape the sides tell the same.
  EXPECT_NEAR(guess_of(3600, 2400).focal_px, 26.0 / 36.0 * 3600, 0.1);
  EXPECT_NEAR(guess_of(2400, 3600).focal_px, 26.0 / 36.0 * 3600, 0.1);
  EXPECT_NEAR(guess_of(4000, 3000).focal_px, 26.0 / kFilmDiagonalMm * 5000, 0.1);
  EXPECT_EQ(guess_of(4000, 3000).log_sigma, 0.1);
  EXPECT_EQ(guess_of(4000, 3000).source, "EXIF FocalLengthIn35mmFilm 26 mm");
}

TEST(FocalGuess, ElseTakesTheFocalLengthByTheSizeOfTheSensor) {
  const TempDir dir;
  WriteBytes(dir / "a.jpg",
             Jpeg(Tiff()
                      .Rational(kFocalLengthTag, 50, 1)
                      .Rational(kPlaneResolutionTag, 2000, 1)
                      .Short(kPlaneUnitTag, 3)
                      .Short(kPixelXTag, 6000)
                      .Bytes()));
  // 200 pixels a mm; these pictures are a quarter as wide as the camera's.
  const auto guess = FocalGuessOfPictures(dir / "a.jpg", dir / "a.jpg", {1500, 1000}).value();
  EXPECT_NEAR(guess.focal_px, 50.0 * 200.0 / 4.0, 1e-9);
  EXPECT_THAT(guess.source, HasSubstr("EXIF FocalLength 50 mm"));
  // A sensor of a nanometre.
  WriteBytes(dir / "b.jpg",
             Jpeg(Tiff()
                      .Rational(kFocalLengthTag, 50, 1)
                      .Rational(kPlaneResolutionTag, 4'000'000'000U, 1)
                      .Bytes()));
  EXPECT_FALSE(FocalGuessOfPictures(dir / "b.jpg", dir / "b.jpg", {1500, 1000}));
}

TEST(FocalGuess, IsLessSureOfALensThatZooms) {
  const TempDir dir;
  for (const auto& [name, mm] :
       {std::pair("0.jpg", 26), std::pair("1.jpg", 26), std::pair("2.jpg", 52)}) {
    WriteBytes(dir / name, Jpeg(Tiff().Short(kIn35mmTag, static_cast<std::uint16_t>(mm)).Bytes()));
  }
  WriteBytes(dir / "3.jpg", Encoded(".jpg", {300, 200}));
  const double focal_px = 26.0 / kFilmDiagonalMm * std::hypot(300, 200);
  const auto guess_of = [&dir](const char* range) {
    return OpenSequence(dir.path(), Layout::kAuto, FrameRange::Parse(range))->FocalGuessOfFile();
  };
  const auto steady = guess_of("0:2").value();
  EXPECT_NEAR(steady.focal_px, focal_px, 1e-9);
  EXPECT_EQ(steady.log_sigma, 0.1);
  const auto zoomed = guess_of("0:3").value();
  EXPECT_NEAR(zoomed.focal_px, focal_px, 1e-9);
  EXPECT_NEAR(zoomed.log_sigma, std::hypot(0.1, std::log(2.0)), 1e-9);
  EXPECT_THAT(zoomed.source, HasSubstr("in the last picture EXIF FocalLengthIn35mmFilm 52 mm"));
  EXPECT_NEAR(guess_of("2:3").value().focal_px, 2.0 * focal_px, 1e-9);
  EXPECT_EQ(guess_of("1:4").value().log_sigma, 0.1) << "the last one says nothing";
  EXPECT_FALSE(guess_of("3:"));
}

TEST(FocalGuess, IsNoneWhereTheLayoutHasACalibration) {
  const TempDir dir;
  fs::create_directories(dir / "clip/rgb");
  WriteBytes(dir / "clip/rgb/0.png", Png(Tiff().Short(kIn35mmTag, 26).Bytes()));
  test::WriteText(dir / "clip/rgb.txt", "0.0 rgb/0.png\n");
  EXPECT_TRUE(OpenSequence(dir / "clip")->FocalGuessOfFile());
  test::WriteText(dir / "clip/calibration.txt", "280 281 149.5 99.5\n");
  const auto sequence = OpenSequence(dir / "clip");
  EXPECT_TRUE(sequence->KnownCamera());
  EXPECT_FALSE(sequence->FocalGuessOfFile());
}

class FocalGuessOfVideos : public testing::Test {
 protected:
  void SetUp() override {
    cv::VideoWriter writer(dir_ / "plain.mp4",
                           cv::CAP_FFMPEG,
                           cv::VideoWriter::fourcc('m', 'p', '4', 'v'),
                           25.0,
                           cv::Size(160, 120));
    ASSERT_TRUE(writer.isOpened());
    for (int i = 0; i < 3; ++i) writer.write(cv::Mat(120, 160, CV_8UC3, cv::Scalar::all(90)));
  }

  std::optional<FocalGuess> GuessOf(const std::string& name) const {
    return OpenSequence(dir_ / name)->FocalGuessOfFile();
  }

  // plain.mp4 with what a GoPro writes in its header, which is the last box.
  std::string WithSettings(const std::string& settings) const {
    std::string bytes = ReadBytes(dir_ / "plain.mp4");
    const std::size_t moov = bytes.rfind("moov") - 4;
    const std::string gpmf = BigEndian(8 + settings.size(), 4) + "GPMF" + settings;
    const std::string udta = BigEndian(8 + gpmf.size(), 4) + "udta" + gpmf;
    bytes.replace(moov, 4, BigEndian(bytes.size() - moov + udta.size(), 4));
    return bytes + udta;
  }

  TempDir dir_;
};

// An entry of GPMF.
std::string Entry(const std::string& key, char type, int bytes, int count, std::string value) {
  value.resize((value.size() + 3) / 4 * 4);
  return key + type + BigEndian(static_cast<std::uint64_t>(bytes), 1) +
         BigEndian(static_cast<std::uint64_t>(count), 2) + value;
}

std::string SettingsOf(float diagonal_deg, char mode) {
  const std::string inside =
      Entry("DVNM", 'c', 1, 9, "Highlight") + Entry("VFOV", 'c', 1, 1, std::string(1, mode)) +
      Entry("ZFOV", 'f', 4, 1, BigEndian(std::bit_cast<std::uint32_t>(diagonal_deg), 4));
  return Entry("DEVC", '\0', 1, static_cast<int>(inside.size()), inside);
}

TEST_F(FocalGuessOfVideos, IsNoneWhereNothingSaysIt) { EXPECT_FALSE(GuessOf("plain.mp4")); }

TEST_F(FocalGuessOfVideos, IsWhatTheKeyOf35mmFilmSays) {
  if (test::RunShell("ffmpeg -version").exit_code != 0) GTEST_SKIP() << "no ffmpeg";
  const double px_per_mm = std::hypot(160, 120) / kFilmDiagonalMm;
  const auto copy = [this](const std::string& options, const std::string& name) {
    const auto end =
        test::RunShell(fmt::format("cd {} && ffmpeg -nostdin -loglevel error -i "
                                   "plain.mp4 -c copy {} {}",
                                   dir_.path().string(),
                                   options,
                                   name));
    ASSERT_EQ(end.exit_code, 0) << end.err;
  };
  const std::string key = "-metadata com.apple.quicktime.camera.focal_length";
  copy("-movflags use_metadata_tags " + key + ".35mm_equivalent=26", "a.mp4");
  const auto guess = GuessOf("a.mp4").value();
  EXPECT_NEAR(guess.focal_px, 26.0 * px_per_mm, 1e-9);
  EXPECT_EQ(guess.log_sigma, 0.15);
  EXPECT_EQ(guess.source, "the video's metadata (26 mm of 35 mm film)");
  copy("-movflags use_metadata_tags " + key + "_35mm_equivalent=13.5", "b.mov");
  EXPECT_NEAR(GuessOf("b.mov").value().focal_px, 13.5 * px_per_mm, 1e-9);
  copy("-metadata:s:v FOCAL_LENGTH_35MM_EQUIVALENT='77 mm'", "c.mkv");
  EXPECT_NEAR(GuessOf("c.mkv").value().focal_px, 77.0 * px_per_mm, 1e-9);
  int n = 0;
  for (const char* wrong : {"0", "-26", "nan", "inf", "1e300", "wide", ""}) {
    const std::string name = fmt::format("wrong{}.mp4", ++n);
    copy(fmt::format("-movflags use_metadata_tags {}.35mm_equivalent='{}'", key, wrong), name);
    EXPECT_FALSE(GuessOf(name)) << wrong;
  }
}

TEST_F(FocalGuessOfVideos, IsByAGoProsFieldOfView) {
  const auto guess_of = [this](float diagonal_deg, char mode) {
    WriteBytes(dir_ / "a.mp4", WithSettings(SettingsOf(diagonal_deg, mode)));
    return GuessOf("a.mp4");
  };
  const auto linear = guess_of(90.0F, 'L').value();
  EXPECT_NEAR(linear.focal_px, 100.0, 1e-9) << "half the diagonal";
  EXPECT_EQ(linear.log_sigma, 0.15);
  EXPECT_THAT(linear.source, HasSubstr("90 degrees"));
  // A fisheye of 2 radians.
  const auto wide = guess_of(static_cast<float>(360.0 / std::numbers::pi), 'W').value();
  EXPECT_NEAR(wide.focal_px, 100.0, 1e-4);
  EXPECT_EQ(wide.log_sigma, 0.3);
  EXPECT_EQ(guess_of(120.0F, 'M').value().log_sigma, 0.3);
  for (const float wrong : {0.0F, -90.0F, 200.0F, std::nanf(""), INFINITY}) {
    EXPECT_FALSE(guess_of(wrong, 'W')) << wrong;
  }
}

TEST_F(FocalGuessOfVideos, NothingThatIsDamagedIsReadBeyondTheFile) {
  // Too long a box and a box of no length, settings that hold more than there are, or themselves.
  const std::string good = SettingsOf(90.0F, 'L');
  const fs::path file = dir_ / "a.mp4";
  const auto expect_no_nonsense = [&file](const std::string& bytes) {
    WriteBytes(file, bytes);
    const auto view = ReadGoProView(file);
    if (view) FocalGuessOfVideo(file, "", {160, 120});
  };
  const std::string whole = BigEndian(24 + good.size(), 4) + "moov" +
                            BigEndian(16 + good.size(), 4) + "udta" +
                            BigEndian(8 + good.size(), 4) + "GPMF" + good;
  WriteBytes(file, whole);
  ASSERT_TRUE(ReadGoProView(file));
  for (std::size_t i = 0; i < whole.size(); ++i) {
    expect_no_nonsense(whole.substr(0, i));
    for (const char value : {'\0', '\x01', '\x7F', '\xFF'}) {
      std::string changed = whole;
      changed[i] = value;
      expect_no_nonsense(changed);
    }
  }
  std::string nested;
  for (int level = 0; level < 1000; ++level) {
    nested = Entry("DEVC", '\0', 4, static_cast<int>(nested.size() / 4), nested);
  }
  expect_no_nonsense(BigEndian(24 + nested.size(), 4) + "moov" + BigEndian(16 + nested.size(), 4) +
                     "udta" + BigEndian(8 + nested.size(), 4) + "GPMF" + nested);
  std::string boxes;
  for (int i = 0; i < 100'000; ++i) boxes += BigEndian(8, 4) + "moov";
  expect_no_nonsense(boxes);
}

}  // namespace
}  // namespace cohort
