#include "datasets/readers/video_sequence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "datasets/open_sequence.h"
#include "frontend/core/error.h"
#include "frontend/storage/output.h"
#include "tests/datasets/fixtures.h"
#include "tests/support/shared_data.h"
#include "tests/support/shell.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using test::Indices;
using test::TempDir;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr int kFrames = 30;
constexpr double kFramesPerSecond = 25.0;

// 30 frames at 25 Hz; frame i has the grey value 8 i (to a few units after compression), and noise
// in one corner so that frames are of some kilobytes.
void WriteVideo(const std::filesystem::path& file, const char* fourcc) {
  cv::VideoWriter writer(file.string(),
                         cv::CAP_FFMPEG,
                         cv::VideoWriter::fourcc(fourcc[0], fourcc[1], fourcc[2], fourcc[3]),
                         kFramesPerSecond,
                         cv::Size(160, 120));
  ASSERT_TRUE(writer.isOpened());
  cv::RNG random(1);
  for (int i = 0; i < kFrames; ++i) {
    cv::Mat picture(120, 160, CV_8UC3, cv::Scalar::all(8 * i));
    cv::Mat corner = picture(cv::Rect(80, 60, 80, 60));
    random.fill(corner, cv::RNG::UNIFORM, 0, 256);
    writer.write(picture);
  }
}

void ExpectGrey(const Frame& frame) {
  EXPECT_NEAR(frame.gray.at<std::uint8_t>(20, 20), 8 * static_cast<int>(ToInt(frame.index)), 4);
}

TEST(Video, DecodesEveryFrameInOrderWithItsTimeAndName) {
  const TempDir dir;
  for (const auto& [name, fourcc] :
       {std::pair("clip.avi", "MJPG"), std::pair("clip.mp4", "mp4v")}) {
    WriteVideo(dir / name, fourcc);
    const auto sequence = OpenSequence(dir / name);
    EXPECT_EQ(sequence->Name(), name);
    EXPECT_EQ(sequence->ImageRoot(), "");
    EXPECT_EQ(sequence->FrameCount(), kFrames);
    EXPECT_FALSE(sequence->KnownCamera().has_value());
    for (int round = 0; round < 2; ++round) {
      const std::vector<Frame> frames = test::ReadAll(*sequence);
      ASSERT_EQ(frames.size(), kFrames);
      for (const Frame& frame : frames) ExpectGrey(frame);
      EXPECT_EQ(frames[12].name, "frame_000012.png");
      EXPECT_EQ(frames[12].timestamp_ns, 480'000'000);
      EXPECT_EQ(frames[12].gray.type(), CV_8UC1);
      EXPECT_EQ(sequence->Warning(), "");
      sequence->Rewind();
    }
  }
}

TEST(Video, RangesAndStrides) {
  const TempDir dir;
  WriteVideo(dir / "clip.avi", "MJPG");
  const auto read = [&](const char* range) {
    const auto sequence = OpenSequence(dir / "clip.avi", Layout::kAuto, FrameRange::Parse(range));
    const std::vector<Frame> frames = test::ReadAll(*sequence);
    for (const Frame& frame : frames) ExpectGrey(frame);
    EXPECT_EQ(sequence->FrameCount(), frames.size()) << range;
    EXPECT_EQ(sequence->Warning(), "") << range;
    sequence->Rewind();
    EXPECT_EQ(Indices(test::ReadAll(*sequence)), Indices(frames)) << range;
    return Indices(frames);
  };
  EXPECT_THAT(read("3:6"), ElementsAre(3, 4, 5));
  EXPECT_THAT(read("2:30:9"), ElementsAre(2, 11, 20, 29));
  EXPECT_THAT(read("28:"), ElementsAre(28, 29));
  EXPECT_THAT(read("27:1000:2"), ElementsAre(27, 29));
  EXPECT_THAT([&] { read("30:"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("30 frames"), HasSubstr("frame 30"))));
}

TEST(Video, CutShortKeepsWhatCanBeDecodedAndSaysSo) {
  const TempDir dir;
  const std::filesystem::path file = dir / "cut.avi";
  WriteVideo(file, "MJPG");
  test::CutFile(file, 0.6);
  const auto sequence = OpenSequence(file);
  EXPECT_EQ(sequence->FrameCount(), kFrames);  // as the header promises
  const std::vector<Frame> frames = test::ReadAll(*sequence);
  EXPECT_GT(frames.size(), 10u);
  EXPECT_LT(frames.size(), 22u);
  for (std::size_t i = 0; i + 1 < frames.size(); ++i) ExpectGrey(frames[i]);
  EXPECT_THAT(sequence->Warning(),
              AllOf(HasSubstr(fmt::format("decoded {} frames of about 30", frames.size())),
                    HasSubstr("cut.avi")));
  EXPECT_EQ(sequence->FrameCount(), frames.size());

  sequence->Rewind();
  EXPECT_EQ(test::ReadAll(*sequence).size(), frames.size());

  // A range that is all there is not cut.
  const auto begin = OpenSequence(file, Layout::kAuto, FrameRange::Parse("0:10"));
  EXPECT_EQ(test::ReadAll(*begin).size(), 10u);
  EXPECT_EQ(begin->Warning(), "");
}

// Moves the index of an MP4 (moov, at its end) to the front, as players want it for streaming; a
// cut file then still opens. Offsets in stco grow by the size of moov.
void MoveIndexToFront(const std::filesystem::path& file) {
  std::string bytes = ReadBytes(file);
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i)
      value = value << 8 | static_cast<std::uint8_t>(bytes[at + i]);
    return value;
  };
  std::size_t moov = 0;
  std::size_t mdat = 0;
  for (std::size_t box = 0; box + 8 <= bytes.size(); box += word(box)) {
    const std::string kind = bytes.substr(box + 4, 4);
    if (kind == "moov") moov = box;
    if (kind == "mdat") mdat = box;
  }
  ASSERT_LT(mdat, moov);
  const std::uint32_t moov_size = word(moov);
  const std::size_t stco = bytes.find("stco", moov);
  ASSERT_NE(stco, std::string::npos);
  for (std::size_t i = 0; i < word(stco + 8); ++i) {
    const std::size_t at = stco + 12 + 4 * i;
    const std::uint32_t offset = word(at) + moov_size;
    for (std::size_t k = 0; k < 4; ++k) bytes[at + k] = static_cast<char>(offset >> (24 - 8 * k));
  }
  const std::string index = bytes.substr(moov, moov_size);
  bytes.erase(moov, moov_size);
  bytes.insert(mdat, index);
  WriteBytes(file, bytes);
}

TEST(Video, AnMp4WithItsIndexInFrontKeepsWhatCanBeDecoded) {
  const TempDir dir;
  const std::filesystem::path file = dir / "stream.mp4";
  WriteVideo(file, "mp4v");
  MoveIndexToFront(file);
  EXPECT_EQ(test::ReadAll(*OpenSequence(file)).size(), kFrames);

  test::CutFile(file, 0.5);
  const auto sequence = OpenSequence(file);
  const std::size_t frames = test::ReadAll(*sequence).size();
  EXPECT_GT(frames, 5u);
  EXPECT_LT(frames, 25u);
  EXPECT_THAT(sequence->Warning(), HasSubstr(fmt::format("decoded {} frames of about 30", frames)));
}

// FFmpeg hides what lies before the cut, which the header counts; and a sound that goes on.
TEST(Video, APieceOfAVideoAndALongerSoundAreNotCutShort) {
  const TempDir dir;
  WriteVideo(dir / "clip.mp4", "mp4v");
  const std::string ffmpeg =
      fmt::format("cd {} && ffmpeg -nostdin -loglevel error ", dir.path().string());
  for (const char* make :
       {"-ss 0.5 -i clip.mp4 -c copy made.mp4",
        "-i clip.mp4 -f lavfi -i sine=d=1.6 -c:v copy -c:a pcm_s16le made.mkv"}) {
    SCOPED_TRACE(make);
    const test::ProgramEnd end = test::RunShell(ffmpeg + make);
    ASSERT_EQ(end.exit_code, 0) << end.err;
    const std::string name = std::string(make).substr(std::string(make).rfind(' ') + 1);
    const auto sequence = OpenSequence(dir / name);
    EXPECT_GT(test::ReadAll(*sequence).size(), 15u);
    EXPECT_EQ(sequence->Warning(), "");
  }
}

TEST(Video, AnMp4ThatLostItsIndexIsAnError) {
  const TempDir dir;
  WriteVideo(dir / "clip.mp4", "mp4v");
  test::CutFile(dir / "clip.mp4", 0.9);
  EXPECT_THAT([&] { OpenSequence(dir / "clip.mp4"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("clip.mp4"), HasSubstr("index"))));
}

TEST(Video, AFileThatIsNoVideoIsAnError) {
  const TempDir dir;
  for (const char* name : {"notes.txt", "empty.mp4", "tracks.db"}) {
    std::ofstream(dir / name) << (std::string(name) == "empty.mp4" ? "" : "no video\nat all\n");
    EXPECT_THAT([&] { OpenSequence(dir / name); },
                ThrowsMessage<Error>(AllOf(HasSubstr(name), HasSubstr("as a video"))));
  }
}

// To FFmpeg `concat:` and `tcp:` are protocols, and %d is a number.
TEST(Video, ANameIsNoMoreThanAName) {
  const TempDir dir;
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(dir.path());
  WriteVideo("real.avi", "MJPG");
  for (const char* name : {"-i",
                           "concat:real.avi",
                           "http:x.mp4",
                           "tcp:127.0.0.1:9",
                           "a;b.mp4",
                           "pipe:0",
                           "file:a.avi",
                           "a%d.avi",
                           "crypto:real.avi",
                           "$(x).avi"}) {
    std::filesystem::copy_file("real.avi", name);
    EXPECT_EQ(test::ReadAll(*OpenSequence(name)).size(), std::size_t{kFrames}) << name;
  }
  // A pattern of pictures, if it were one.
  cv::imwrite("0.png", cv::Mat(120, 160, CV_8UC1, cv::Scalar(7)));
  for (int i = 0; i < 4; ++i) std::filesystem::copy_file("0.png", fmt::format("s{}.apng", i));
  std::filesystem::copy_file("real.avi", "s%d.apng");
  EXPECT_EQ(test::ReadAll(*OpenSequence("s%d.apng")).size(), std::size_t{kFrames});
  std::filesystem::current_path(before);
}

// FFmpeg would read what they name.
TEST(Video, AListOfOtherFilesIsNone) {
  const TempDir dir;
  WriteVideo(dir / "real.mp4", "mp4v");
  const std::string hls = "#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\n" +
                          (dir / "real.mp4").string() + "\n#EXT-X-ENDLIST\n";
  // A tag of music in front hides it from a look at the first bytes alone.
  std::string tag(137, '\0');
  tag.replace(0, 4, "ID3\x04");
  tag[9] = 127;
  for (const std::string& list : {hls,
                                  tag + hls,
                                  std::string("ffconcat version 1.0\nfile real.mp4\n"),
                                  std::string("<?xml version=\"1.0\"?><MPD profiles=\"urn:mpeg:"
                                              "DASH:profile:isoff-live:2011\"></MPD>")}) {
    std::ofstream(dir / "list.mp4") << list;
    EXPECT_THAT(
        [&] { OpenSequence(dir / "list.mp4"); },
        ThrowsMessage<Error>(AllOf(HasSubstr("list.mp4"), HasSubstr("list of other files"))))
        << list;
  }
}

TEST(Video, ReadsTheSharedClip) {
  const auto file = test::SharedData("opencv_box/box.mp4");
  COHORT_SKIP_WITHOUT(file);
  const auto sequence = OpenSequence(file, Layout::kAuto, FrameRange::Parse("400:"));
  const std::vector<Frame> frames = test::ReadAll(*sequence);
  EXPECT_EQ(frames.size(), 55u);
  EXPECT_EQ(frames.front().gray.size(), cv::Size(640, 480));
  EXPECT_EQ(sequence->Warning(), "");
}

}  // namespace
}  // namespace cohort
