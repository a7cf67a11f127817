#include "datasets/readers/video_decoder.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "datasets/open_sequence.h"
#include "frontend/core/child_process.h"
#include "frontend/core/error.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/output.h"
#include "tests/datasets/fixtures.h"
#include "tests/support/shell.h"
#include "tests/support/temp_dir.h"

// The files are made by the program ffmpeg, and what it makes of them is the reference.

namespace cohort {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

class Decoder : public testing::Test {
 protected:
  void SetUp() override {
    if (!FindProgram("ffmpeg")) GTEST_SKIP() << "no ffmpeg";
  }

  std::string Path(const std::string& name) const { return dir_ / name; }

  void Ffmpeg(const std::string& arguments) const {
    const test::ProgramEnd end = test::RunShell(
        fmt::format("cd '{}' && ffmpeg -loglevel error -y {}", dir_.path().string(), arguments));
    ASSERT_EQ(end.exit_code, 0) << arguments << "\n" << end.err;
  }

  // Ten noisy frames at 25 Hz.
  void Film(const std::string& name,
            const std::string& codec,
            const std::string& filters = "null",
            const char* size = "160x120") const {
    Ffmpeg(
        fmt::format("-f lavfi -i testsrc2=size={}:rate=25:duration=0.4,"
                    "noise=alls=20:allf=t:all_seed=1 -vf \"{}\" -fps_mode passthrough {} {}",
                    size,
                    filters,
                    codec,
                    name));
  }

  // By the program, which turns them as the file says.
  std::vector<cv::Mat> PicturesOfFfmpeg(const std::string& name,
                                        cv::Size size,
                                        const std::string& filters = "null") const {
    Ffmpeg("-i " + name + " -fps_mode passthrough -sws_flags bicubic -vf " + filters +
           " -pix_fmt bgr24 -f rawvideo raw");
    std::string bytes = ReadBytes(Path("raw"));
    const std::size_t one = static_cast<std::size_t>(size.area()) * 3;
    EXPECT_EQ(bytes.size() % one, 0u);
    std::vector<cv::Mat> pictures;
    for (std::size_t at = 0; at + one <= bytes.size(); at += one) {
      pictures.push_back(cv::Mat(size, CV_8UC3, bytes.data() + at).clone());
    }
    return pictures;
  }

  std::vector<cv::Mat> Pictures(const std::string& name,
                                std::optional<FieldOrder> deinterlaced = std::nullopt) const {
    std::vector<cv::Mat> pictures;
    VideoDecoder video(Path(name), deinterlaced);
    while (video.Next()) pictures.push_back(video.Picture());
    return pictures;
  }

  std::vector<cv::Mat> Grays(const std::string& name) const {
    std::vector<cv::Mat> grays;
    VideoDecoder video(Path(name));
    while (video.Next()) grays.push_back(video.Gray());
    return grays;
  }

  // Pictures as `sfm` writes them.
  std::vector<cv::Mat> ColorsOfSequence(const std::string& name) const {
    std::vector<cv::Mat> colors;
    for (const Frame& frame : test::ReadAll(*OpenSequence(Path(name)))) {
      colors.push_back(frame.color);
    }
    return colors;
  }

  // 24 fields, of each of which a frame gets every other row. They move by 3 px.
  void FilmFields(const std::string& name,
                  const std::string& codec,
                  const std::string& fields,
                  const std::string& after = "null") const {
    Ffmpeg(
        fmt::format("-f lavfi -i testsrc2=size=160x120:rate=50:duration=0.02,loop=23:1,"
                    "scroll=h=0.02 -vf \"{},{}\" -fps_mode passthrough {} {}",
                    fields,
                    after,
                    codec,
                    name));
  }

  std::vector<int> Milliseconds(const std::string& name) const {
    std::vector<int> times;
    VideoDecoder video(Path(name));
    while (video.Next()) times.push_back(static_cast<int>(std::lround(video.Seconds() * 1000.0)));
    return times;
  }

  void ChangeBytes(const std::string& name, std::size_t at, std::string_view bytes) const {
    std::string file = ReadBytes(Path(name));
    ASSERT_LE(at + bytes.size(), file.size());
    WriteBytes(Path(name), file.replace(at, bytes.size(), bytes));
  }

  std::size_t Find(const std::string& name, std::string_view mark) const {
    return ReadBytes(Path(name)).find(mark);
  }

  test::TempDir dir_;
};

void ExpectEqual(const std::vector<cv::Mat>& pictures, const std::vector<cv::Mat>& expected) {
  ASSERT_EQ(pictures.size(), expected.size());
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    ASSERT_EQ(pictures[i].size(), expected[i].size());
    EXPECT_EQ(cv::norm(pictures[i], expected[i], cv::NORM_INF), 0.0) << "frame " << i;
  }
}

TEST_F(Decoder, AlphaIsAFourthChannelAndChangesNoColour) {
  const std::string cut = "format=argb,geq=r='r(X,Y)':g='g(X,Y)':b='b(X,Y)':a='";
  Film("opaque.mov", "-c:v qtrle", cut + "255'");
  EXPECT_EQ(Pictures("opaque.mov").front().type(), CV_8UC3) << "there is nothing to mask";
  Film("cut.mov", "-c:v qtrle", cut + "255*gte(X,40)'");
  const std::vector<cv::Mat> opaque = PicturesOfFfmpeg("cut.mov", {160, 120});
  const std::vector<cv::Mat> pictures = Pictures("cut.mov");
  ASSERT_EQ(pictures.size(), opaque.size());
  ASSERT_EQ(pictures.front().type(), CV_8UC4);
  std::vector<cv::Mat> channels;
  cv::split(pictures.back(), channels);
  EXPECT_EQ(cv::countNonZero(channels[3]), (160 - 40) * 120);
  EXPECT_EQ(channels[3].at<std::uint8_t>(60, 39), 0);
  channels.pop_back();
  cv::Mat colors;
  cv::merge(channels, colors);
  EXPECT_EQ(cv::norm(colors, opaque.back(), cv::NORM_INF), 0.0);
}

TEST_F(Decoder, GivesTheSamePicturesAsTheProgramFfmpeg) {
  const std::string quick = "-c:v libx264 -preset ultrafast -pix_fmt ";
  const std::string hevc = "-c:v libx265 -preset ultrafast -x265-params log-level=0 -pix_fmt ";
  const std::string odd = "-vf scale=161x121 ";
  const std::vector<std::pair<std::string, std::string>> files{
      {"a.mp4", quick + "yuv420p"},
      {"a.mkv", quick + "yuv422p"},
      {"b.mp4", quick + "yuv444p"},
      {"ten.mp4", quick + "yuv420p10le"},
      {"grey.mp4", quick + "gray"},
      {"full.mp4", quick + "yuvj420p"},
      {"full_ten.mp4", quick + "yuv420p10le -color_range pc"},
      {"fields.mp4", quick + "yuv420p -flags +ilme+ildct -x264opts tff=1"},
      {"fields.mpg", "-c:v mpeg2video -flags +ilme+ildct"},
      {"b_frames.mpg", "-c:v mpeg1video -bf 2"},
      {"twelve.mp4", hevc + "yuv420p12le"},
      {"full.webm", "-c:v libvpx-vp9 -cpu-used 8 -color_range pc"},
      {"odd.webm", odd + "-c:v libvpx-vp9 -cpu-used 8"},
      {"a.webm", "-c:v libvpx -cpu-used 8"},
      {"odd.avi", odd + "-c:v mjpeg"},
      {"colours.avi", "-c:v rawvideo -pix_fmt bgr24"},
      {"packed.avi", "-c:v rawvideo -pix_fmt yuyv422"},
      {"alpha.mkv", "-c:v ffv1 -pix_fmt yuva420p"},
      {"odd.mkv", odd + "-c:v ffv1 -pix_fmt yuv420p"},
      {"deep.mkv", "-c:v ffv1 -pix_fmt gray16le"},
      {"a.mov", "-c:v prores_ks"},
      {"a.gif", ""}};
  std::string outputs;
  for (const auto& [name, codec] : files) {
    outputs += fmt::format("{} -fps_mode passthrough {} ", codec, name);
  }
  // No block of a codec divides the sides.
  Ffmpeg("-f lavfi -i testsrc2=size=164x124:rate=25:duration=0.4,noise=alls=20:allf=t " + outputs);
  for (const auto& [name, codec] : files) {
    SCOPED_TRACE(name);
    const std::vector<cv::Mat> expected =
        PicturesOfFfmpeg(name, codec.starts_with(odd) ? cv::Size(161, 121) : cv::Size(164, 124));
    EXPECT_EQ(expected.size(), 10u);
    ExpectEqual(Pictures(name), expected);
  }
}

// FFmpeg takes what states no matrix as BT.601, in HD too.
TEST_F(Decoder, ColoursAreThoseOfTheProgramFfmpeg) {
  const std::string deep = "-c:v libx265 -preset ultrafast -x265-params log-level=0 -pix_fmt ";
  const std::string h264 = "-c:v libx264 -preset ultrafast -pix_fmt ";
  std::string outputs;
  std::vector<std::string> names;
  for (const std::string matrix :
       {"unknown", "bt709", "bt470bg", "smpte170m", "smpte240m", "bt2020nc", "fcc"}) {
    for (const std::string range : {"tv", "pc"}) {
      std::vector<std::string> codecs{h264 + "yuv420p", deep + "yuv422p10le"};
      if (matrix == "bt709") {
        codecs.insert(
            codecs.end(),
            {h264 + "yuv422p", h264 + "yuv444p", deep + "yuv420p10le", deep + "yuv444p10le"});
      }
      for (const std::string& codec : codecs) {
        names.push_back(fmt::format("{}.mp4", names.size()));
        outputs += fmt::format(
            "-colorspace {} -color_range {} {} {} ", matrix, range, codec, names.back());
      }
    }
  }
  Ffmpeg("-f lavfi -i testsrc2=size=162x122:rate=25:duration=0.08 " + outputs);
  for (const std::string& name : names) {
    SCOPED_TRACE(name);
    ExpectEqual(Pictures(name), PicturesOfFfmpeg(name, {162, 122}));
    ExpectEqual(ColorsOfSequence(name), Pictures(name));
  }
  Ffmpeg("-f lavfi -i testsrc2=size=1280x720:rate=25:duration=0.08 " + h264 + "yuv420p hd.mp4");
  ExpectEqual(Pictures("hd.mp4"), PicturesOfFfmpeg("hd.mp4", {1280, 720}));
}

// With the right matrix, the colours are those that were filmed, to FFmpeg's rounding.
TEST_F(Decoder, ColoursAreThoseThatWereFilmed) {
  std::string outputs;
  for (const char* matrix : {"bt709", "smpte170m", "smpte240m", "bt2020nc"}) {
    for (const char* range : {"tv", "pc"}) {
      outputs += fmt::format(
          "-vf scale=out_color_matrix={0}:out_range={1},format=yuv420p -colorspace {0} "
          "-color_range {1} -c:v libx264 -crf 1 {0}_{1}.mp4 ",
          matrix,
          range);
    }
  }
  Ffmpeg("-f lavfi -i color=0x2878c8:size=96x48:rate=5:duration=0.2,format=gbrp " + outputs);
  for (const char* matrix : {"bt709", "smpte170m", "smpte240m", "bt2020nc"}) {
    for (const char* range : {"tv", "pc"}) {
      SCOPED_TRACE(fmt::format("{} {}", matrix, range));
      const cv::Scalar color = cv::mean(Pictures(fmt::format("{}_{}.mp4", matrix, range)).at(0));
      EXPECT_NEAR(color[0], 0xc8, 3);
      EXPECT_NEAR(color[1], 0x78, 3);
      EXPECT_NEAR(color[2], 0x28, 3);
    }
  }
}

TEST_F(Decoder, GreyIsTheLumaWhateverTheMatrix) {
  const std::string codec = "-c:v ffv1 -pix_fmt yuv420p -colorspace ";
  std::string outputs;
  for (const char* matrix : {"unknown", "bt709", "bt2020nc"}) {
    outputs += codec + matrix + " " + matrix + ".mkv ";
  }
  Ffmpeg("-f lavfi -i testsrc2=size=160x120:rate=25:duration=0.08 " + outputs);
  const std::vector<cv::Mat> grays = Grays("unknown.mkv");
  EXPECT_EQ(grays.size(), 2u);
  ExpectEqual(Grays("bt709.mkv"), grays);
  ExpectEqual(Grays("bt2020nc.mkv"), grays);
  std::vector<cv::Mat> of_sequence;
  for (const Frame& frame : test::ReadAll(*OpenSequence(Path("bt709.mkv")))) {
    of_sequence.push_back(frame.gray);
  }
  ExpectEqual(of_sequence, grays);
}

// Documented in datasets/README.md.
constexpr const char* kToneMapping =
    "zscale=t=linear:npl=203:p=bt709,format=gbrpf32le,"
    "tonemap=mobius:param=0.7:desat=0:peak=10,zscale=t=iec61966-2-1,format=gbrp";

TEST_F(Decoder, HdrIsToneMapped) {
  const std::string hevc = "-c:v libx265 -preset ultrafast -x265-params log-level=0:lossless=1 ";
  for (const auto& [kind, transfer] :
       {std::pair("HLG", "arib-std-b67"), std::pair("PQ", "smpte2084")}) {
    SCOPED_TRACE(kind);
    const std::string tags = fmt::format(
        "-color_primaries bt2020 -color_trc {} -colorspace bt2020nc -color_range tv ", transfer);
    Ffmpeg(
        fmt::format("-f lavfi -i smptehdbars=size=160x120:rate=25:duration=0.2,format=gbrp -vf "
                    "zscale=tin=iec61966-2-1:pin=bt709:t={}:p=bt2020:m=bt2020nc:r=tv:npl=203,"
                    "format=yuv420p10le {} {} a.mp4",
                    transfer,
                    tags,
                    hevc));
    const std::vector<cv::Mat> pictures = Pictures("a.mp4");
    EXPECT_EQ(pictures.size(), 5u);
    ExpectEqual(pictures, PicturesOfFfmpeg("a.mp4", {160, 120}, kToneMapping));
    // What is not near white is as it was filmed.
    const cv::Rect yellow(42, 10, 8, 40);
    const cv::Scalar color = cv::mean(pictures.at(0)(yellow));
    EXPECT_NEAR(color[0], 0, 6);
    EXPECT_NEAR(color[1], 191, 6);
    EXPECT_NEAR(color[2], 191, 6);

    const auto clip = OpenSequence(Path("a.mp4"));
    EXPECT_THAT(clip->Warning(),
                AllOf(HasSubstr("a.mp4 is HDR video"), HasSubstr(kind), HasSubstr("tone-mapped")));
    const std::vector<Frame> frames = test::ReadAll(*clip);
    ASSERT_EQ(frames.size(), 5u);
    EXPECT_EQ(cv::norm(frames[3].color, pictures[3], cv::NORM_INF), 0);
    cv::Mat gray;
    cv::cvtColor(pictures[3], gray, cv::COLOR_BGR2GRAY);
    EXPECT_EQ(cv::norm(frames[3].gray, gray, cv::NORM_INF), 0);

    // A file that states the transfer alone, in odd sizes and other pixels.
    Ffmpeg(fmt::format(
        "-i a.mp4 -vf scale=161:121,format=yuv422p10le,setparams=colorspace=unknown:"
        "color_primaries=unknown -color_trc {} -colorspace unknown -color_primaries unknown "
        "-c:v ffv1 bare.mkv",
        transfer));
    EXPECT_EQ(ColorsOfSequence("bare.mkv").size(), 5u);
  }
  // SDR in BT.2020 is not HDR.
  Film("sdr.mp4", "-c:v libx264 -color_primaries bt2020 -color_trc bt2020-10 -colorspace bt2020nc");
  EXPECT_EQ(OpenSequence(Path("sdr.mp4"))->Warning(), "");
}

struct Fields {
  const char* name;
  const char* codec;
  const char* order;  // of the filter tinterlace
  const char* parity;
  const char* after = "null";
  bool flagged = true;
};

TEST_F(Decoder, InterlacedFramesAreDeinterlaced) {
  const char* const kTop = "interleave_top";
  const char* const kBottom = "interleave_bottom";
  const char* const kFields = "-c:v libx264 -crf 10 -flags +ilme+ildct -x264opts";
  const char* const kPlain = "-c:v libx264 -crf 10";
  const std::string top = std::string(kFields) + " tff=1";
  const std::string bottom = std::string(kFields) + " bff=1";
  for (const Fields& fields :
       {Fields{"top.mts", top.c_str(), kTop, "tff"},
        Fields{"bottom.mp4", bottom.c_str(), kBottom, "bff"},
        Fields{"dvd.mpg", "-c:v mpeg2video -q:v 2 -flags +ilme+ildct", kTop, "tff"},
        Fields{"container.mov", "-c:v rawvideo -pix_fmt uyvy422 -field_order tt", kTop, "tff"},
        // A wrong flag does not count.
        Fields{"wrong.mp4", bottom.c_str(), kTop, "tff"},
        Fields{"plain_top.mp4", kPlain, kTop, "tff", "setfield=prog", false},
        Fields{"plain_bottom.mkv", kPlain, kBottom, "bff", "setfield=prog", false}}) {
    SCOPED_TRACE(fields.name);
    FilmFields(fields.name, fields.codec, std::string("tinterlace=") + fields.order, fields.after);
    const std::vector<cv::Mat> expected = PicturesOfFfmpeg(
        fields.name,
        {160, 120},
        fmt::format("{}bwdif=mode=send_frame:parity={}",
                    std::string(fields.name) == "container.mov" ? "format=yuv422p," : "",
                    fields.parity));
    ASSERT_EQ(expected.size(), 12u);
    ExpectEqual(ColorsOfSequence(fields.name), expected);
    const auto clip = OpenSequence(Path(fields.name));
    const bool is_top = std::string(fields.parity) == "tff";
    EXPECT_THAT(clip->Warning(),
                AllOf(HasSubstr(fields.name),
                      HasSubstr(fields.flagged ? " is interlaced, " : "does not state"),
                      HasSubstr(is_top ? "top field first" : "bottom field first"),
                      HasSubstr("deinterlaced")));
    // Ranges and a second reading give the same frames, with the times of the file.
    const std::vector<Frame> all = test::ReadAll(*clip);
    ASSERT_EQ(all.size(), 12u);
    EXPECT_EQ(clip->FrameCount(), 12u);
    EXPECT_EQ(all[11].timestamp_ns, 440'000'000);
    clip->Rewind();
    EXPECT_EQ(test::ReadAll(*clip).size(), 12u);
    const auto part = OpenSequence(Path(fields.name), Layout::kAuto, FrameRange::Parse("5:12:3"));
    const std::vector<Frame> some = test::ReadAll(*part);
    ASSERT_THAT(test::Indices(some), ElementsAre(5, 8, 11));
    for (const Frame& frame : some) {
      const Frame& same = all[ToInt(frame.index)];
      EXPECT_EQ(frame.timestamp_ns, same.timestamp_ns);
      EXPECT_EQ(cv::norm(frame.gray, same.gray, cv::NORM_INF), 0);
    }
  }
}

// Film of 24 frames a second, of which two of five frames at 30 have the fields of two pictures. They
// are not flagged.
TEST_F(Decoder, TelecinedFilmIsDeinterlaced) {
  for (const auto& [name, field, parity] :
       {std::tuple("top.mp4", "top", "tff"), std::tuple("bottom.mp4", "bottom", "bff")}) {
    SCOPED_TRACE(name);
    FilmFields(name,
               "-c:v libx264 -crf 10",
               fmt::format("fps=24,telecine=first_field={}:pattern=23", field),
               "setfield=prog");
    ExpectEqual(
        ColorsOfSequence(name),
        PicturesOfFfmpeg(name, {160, 120}, fmt::format("bwdif=mode=send_frame:parity={}", parity)));
  }
}

// Also those that are flagged as interlaced, as some cameras' are.
TEST_F(Decoder, ProgressiveFramesAreNotDeinterlaced) {
  const std::string flags = "-c:v libx264 -flags +ilme+ildct -x264opts tff=1";
  for (const auto& [name, codec] :
       {std::pair("plain.mp4", std::string("-c:v libx264")), std::pair("flagged.mp4", flags)}) {
    SCOPED_TRACE(name);
    FilmFields(name, codec, "null");
    EXPECT_EQ(OpenSequence(Path(name))->Warning(), "");
    const std::vector<cv::Mat> expected = PicturesOfFfmpeg(name, {160, 120});
    ASSERT_EQ(expected.size(), 24u);
    ExpectEqual(ColorsOfSequence(name), expected);
  }
  // What does not move shows nothing: the flags decide.
  for (const auto& [name, codec, deinterlaced] :
       {std::tuple("still.mp4", std::string("-c:v libx264"), false),
        std::tuple("flagged_still.mp4", flags, true)}) {
    Ffmpeg(
        fmt::format("-f lavfi -i color=gray:size=160x120:rate=25:duration=0.4 {} {}", codec, name));
    const std::string warning = OpenSequence(Path(name))->Warning();
    EXPECT_EQ(warning.find("deinterlaced") != std::string::npos, deinterlaced) << name;
  }
}

TEST_F(Decoder, AnInterlacedVideoMayBeShortOrChangeItsSize) {
  const std::string flags = "-c:v libx264 -flags +ilme+ildct -x264opts tff=1 ";
  Ffmpeg("-f lavfi -i testsrc2=size=160x120:rate=25:duration=0.04 " + flags + "one.h264");
  EXPECT_EQ(ColorsOfSequence("one.h264").size(), 1u);
  Ffmpeg("-f lavfi -i testsrc2=size=320x240:rate=25:duration=0.4 " + flags + "other.h264");
  WriteBytes(Path("change.h264"), ReadBytes(Path("one.h264")) + ReadBytes(Path("other.h264")));
  EXPECT_THAT([&] { test::ReadAll(*OpenSequence(Path("change.h264"))); },
              ThrowsMessage<Error>(AllOf(HasSubstr("change.h264"), HasSubstr("320x240"))));
}

// Black and white of both ranges are 0 and 255; grey of the picture is the file's luma.
TEST_F(Decoder, SpreadsLimitedRange) {
  std::string outputs;
  for (const char* range : {"tv", "pc"}) {
    for (const char* format : {"yuv420p", "yuv420p10le"}) {
      outputs +=
          fmt::format("-vf scale=out_range={0},format={1} -color_range {0} -c:v ffv1 {0}_{1}.mkv ",
                      range,
                      format);
    }
  }
  Ffmpeg(
      "-f lavfi -i color=black:size=96x48:rate=5:duration=0.2,"
      "drawbox=x=32:w=32:h=48:color=0x646464:t=fill,drawbox=x=64:w=32:h=48:color=white:t=fill " +
      outputs);
  for (const char* name :
       {"tv_yuv420p.mkv", "pc_yuv420p.mkv", "tv_yuv420p10le.mkv", "pc_yuv420p10le.mkv"}) {
    SCOPED_TRACE(name);
    const cv::Mat gray = test::ReadAll(*OpenSequence(Path(name)))[0].gray;
    EXPECT_NEAR(cv::mean(gray.colRange(4, 28))[0], 0, 1.5);
    EXPECT_NEAR(cv::mean(gray.colRange(36, 60))[0], 100, 1.5);
    EXPECT_NEAR(cv::mean(gray.colRange(68, 92))[0], 255, 1.5);
  }
}

// The display matrix of an MP4's track maps (x, y) to (a x + c y, b x + d y).
TEST_F(Decoder, APhonesPortraitVideoStandsUpright) {
  struct Turn {
    int a, b, c, d;
    RowOrder rows;
  };
  Film("a.mp4", "-c:v mpeg4");
  const std::size_t matrix = Find("a.mp4", "tkhd") + 44;
  for (const Turn& turn : {Turn{1, 0, 0, 1, RowOrder::kDown},
                           Turn{0, 1, -1, 0, RowOrder::kLeft},
                           Turn{-1, 0, 0, -1, RowOrder::kUp},
                           Turn{0, -1, 1, 0, RowOrder::kRight},
                           // Mirrors, of a camera that looks at its user.
                           Turn{-1, 0, 0, 1, RowOrder::kDown},
                           Turn{1, 0, 0, -1, RowOrder::kUp},
                           Turn{0, 1, 1, 0, RowOrder::kRight},
                           Turn{0, -1, -1, 0, RowOrder::kLeft}}) {
    SCOPED_TRACE(fmt::format("{} {} {} {}", turn.a, turn.b, turn.c, turn.d));
    std::string numbers;  // of 16.16 bits
    for (const int value : {turn.a, turn.b, 0, turn.c, turn.d}) {
      numbers += {static_cast<char>(value < 0 ? 255 : 0), static_cast<char>(value), 0, 0};
    }
    ChangeBytes("a.mp4", matrix, numbers);
    const cv::Size size = turn.a == 0 ? cv::Size(120, 160) : cv::Size(160, 120);
    ExpectEqual(Pictures("a.mp4"), PicturesOfFfmpeg("a.mp4", size));
    const auto clip = OpenSequence(Path("a.mp4"));
    EXPECT_EQ(test::ReadAll(*clip)[0].gray.size(), size);
    EXPECT_EQ(clip->SensorRows(), turn.rows);
  }
}

// As HDV, DV and DVDs store them.
TEST_F(Decoder, PixelsThatAreNotSquareAreMadeSo) {
  const auto film = [&](const std::string& name, const std::string& aspect) {
    Film(name, "-c:v mpeg4", "setsar=" + aspect);
  };
  film("hdv.mp4", "4/3");
  film("dv.mkv", "8/9");
  for (const auto& [name, size] :
       {std::pair("hdv.mp4", cv::Size(213, 120)), std::pair("dv.mkv", cv::Size(142, 120))}) {
    SCOPED_TRACE(name);
    Ffmpeg(
        fmt::format("-i {} -vf scale={}:{}:flags=bicubic,setsar=1 -c:v ffv1 -pix_fmt bgr24 s.mkv",
                    name,
                    size.width,
                    size.height));
    ExpectEqual(Pictures(name), PicturesOfFfmpeg("s.mkv", size));
    const auto clip = OpenSequence(Path(name));
    EXPECT_EQ(test::ReadAll(*clip)[0].gray.size(), size);
    EXPECT_THAT(clip->Warning(),
                AllOf(HasSubstr(name),
                      HasSubstr("not square"),
                      HasSubstr(fmt::format("{}x{}", size.width, size.height))));
  }
  // Upright: what is stored as the width is shown as the height.
  ChangeBytes(
      "hdv.mp4", Find("hdv.mp4", "tkhd") + 44, {"\0\0\0\0\0\1\0\0\0\0\0\0\377\377\0\0", 16});
  EXPECT_EQ(Pictures("hdv.mp4")[0].size(), cv::Size(120, 213));
}

TEST_F(Decoder, APixelAspectThatNoCameraHasIsNone) {
  for (const char* aspect : {"1/1", "161/160", "8/1", "1/8"}) {
    Film("a.mkv", "-c:v ffv1", fmt::format("setsar={}", aspect));
    const auto clip = OpenSequence(Path("a.mkv"));
    EXPECT_EQ(test::ReadAll(*clip)[0].gray.size(), cv::Size(160, 120)) << aspect;
    EXPECT_EQ(clip->Warning(), "") << aspect;
  }
}

// Of Matroska only how long it is: a second of slack for the sound hid half of a short clip.
TEST_F(Decoder, AMatroskaThatIsCutShortIsToldToTheFrame) {
  const auto warning = [&](const std::string& name) {
    const auto clip = OpenSequence(Path(name));
    test::ReadAll(*clip);
    return clip->Warning();
  };
  Film("whole.mkv", "-c:v mpeg4 -g 1");
  EXPECT_EQ(warning("whole.mkv"), "");
  const std::string bytes = ReadBytes(Path("whole.mkv"));
  for (const double share : {0.3, 0.5, 0.7}) {
    WriteBytes(Path("cut.mkv"), bytes.substr(0, static_cast<std::size_t>(share * bytes.size())));
    EXPECT_THAT(warning("cut.mkv"), HasSubstr("truncated")) << share;
  }
  // Frames that were not exposed in time are none that are missing.
  Film("dark.mkv", "-c:v mpeg4", "select='not(between(n,3,7))'");
  EXPECT_EQ(warning("dark.mkv"), "");
}

TEST_F(Decoder, TimesAreTheFiles) {
  // A phone in the dark: frames 3 to 5 were not exposed in time.
  Film("a.mp4", "-c:v mpeg4", "select='not(between(n,3,5))'");
  EXPECT_THAT(Milliseconds("a.mp4"), ElementsAre(0, 40, 80, 240, 280, 320, 360));
  // A clip that is cut out of another begins at 0 too.
  Film("late.mkv", "-c:v mpeg4 -output_ts_offset 3", "select='not(between(n,3,5))'");
  EXPECT_THAT(Milliseconds("late.mkv"), ElementsAre(0, 40, 80, 240, 280, 320, 360));
  // Frames that are stored out of order.
  Film("b_frames.mp4", "-c:v mpeg4 -bf 2");
  EXPECT_THAT(Milliseconds("b_frames.mp4"),
              ElementsAre(0, 40, 80, 120, 160, 200, 240, 280, 320, 360));
}

TEST_F(Decoder, TimesThatAreMissingOrStandStillAreOfEvenFrames) {
  Film("bare.h264", "-c:v libx264 -bf 0");
  Film("a.mp4", "-c:v mpeg4");
  Ffmpeg("-i a.mp4 -c copy -bsf:v setts=ts=0 still.mkv");
  Ffmpeg("-i a.mp4 -c copy -bsf:v \"setts=ts=if(gte(N\\,4)\\,120\\,N*40)\" stops.mkv");
  for (const char* name : {"bare.h264", "still.mkv", "stops.mkv"}) {
    EXPECT_THAT(Milliseconds(name), ElementsAre(0, 40, 80, 120, 160, 200, 240, 280, 320, 360))
        << name;
  }
}

TEST_F(Decoder, FramesThatAreSkippedKeepTheTimesOfTheOthers) {
  Film("a.mp4", "-c:v mpeg4", "select='not(between(n,3,5))'");
  const auto clip = OpenSequence(Path("a.mp4"), Layout::kAuto, FrameRange::Parse("2::2"));
  const std::vector<Frame> frames = test::ReadAll(*clip);
  ASSERT_THAT(test::Indices(frames), ElementsAre(2, 4, 6));
  EXPECT_EQ(frames[0].timestamp_ns, 80'000'000);
  EXPECT_EQ(frames[1].timestamp_ns, 280'000'000);
  EXPECT_EQ(frames[2].timestamp_ns, 360'000'000);
}

TEST_F(Decoder, ADamagedPacketCostsItsFrameAlone) {
  Film("a.avi", "-c:v mjpeg");
  std::string bytes = ReadBytes(Path("a.avi"));
  std::size_t frame = 0;
  for (int i = 0; i < 5; ++i) frame = bytes.find("\xff\xd8\xff", frame + 1);
  ChangeBytes("a.avi", frame, std::string(400, '\0'));
  const std::vector<cv::Mat> pictures = Pictures("a.avi");
  EXPECT_EQ(pictures.size(), 9u);
  ExpectEqual(pictures, PicturesOfFfmpeg("a.avi", {160, 120}));
}

TEST_F(Decoder, FramesThatChangeTheirSizeAreAnError) {
  Film("a.h264", "-c:v libx264");
  Film("b.h264", "-c:v libx264", "null", "320x240");
  Film("c.h264", "-c:v libx264", "null", "64x48");
  for (const char* other : {"b.h264", "c.h264"}) {
    WriteBytes(Path("change.h264"), ReadBytes(Path("a.h264")) + ReadBytes(Path(other)));
    EXPECT_THAT([&] { test::ReadAll(*OpenSequence(Path("change.h264"))); },
                ThrowsMessage<Error>(AllOf(HasSubstr("frame_000010.png"), HasSubstr("160x120"))));
  }
}

// Of OpenCV's reader such a header had read past the end of the frame.
TEST_F(Decoder, AFrameThatIsSmallerThanItsHeaderSaysHasTheSizeThatItHas) {
  Film("a.mkv", "-c:v mpeg4", "null", "320x256");
  // Matroska's width and height: a mark, the count of bytes, the value.
  const std::size_t header = Find("a.mkv", "\xb0\x82\x01\x40\xba\x82");
  ChangeBytes("a.mkv", header + 2, std::string("\x08\x00", 2));
  ChangeBytes("a.mkv", header + 6, std::string("\x08\x00", 2));
  const std::vector<cv::Mat> pictures = Pictures("a.mkv");
  ASSERT_EQ(pictures.size(), 10u);
  EXPECT_EQ(pictures[0].size(), cv::Size(320, 256));
}

TEST_F(Decoder, AbsurdSizesAreRefusedInALine) {
  // 60000 = 0xea60.
  Film("a.avi", "-c:v mjpeg");
  ChangeBytes("a.avi", Find("a.avi", "strf") + 12, std::string("\x60\xea\0\0\x60\xea\0\0", 8));
  Film("a.mkv", "-c:v mpeg4", "null", "320x256");
  const std::size_t header = Find("a.mkv", "\xb0\x82\x01\x40\xba\x82");
  ChangeBytes("a.mkv", header + 2, "\xea\x60");
  ChangeBytes("a.mkv", header + 6, "\xea\x60");
  for (const char* name : {"a.avi", "a.mkv"}) {
    EXPECT_THAT([&] { OpenSequence(Path(name)); },
                ThrowsMessage<Error>(AllOf(HasSubstr(name), HasSubstr("60000x60000"))));
  }
  // Where only the frames themselves say so.
  Film("b.avi", "-c:v mjpeg");
  std::string bytes = ReadBytes(Path("b.avi"));
  for (std::size_t at = 0; (at = bytes.find("\xff\xc0", at + 1)) != std::string::npos;) {
    bytes.replace(at + 5, 4, "\xea\x60\xea\x60");
  }
  WriteBytes(Path("b.avi"), bytes);
  EXPECT_THAT([&] { OpenSequence(Path("b.avi")); },
              ThrowsMessage<Error>(AllOf(HasSubstr("b.avi"), HasSubstr("67108864 pixels"))));
}

TEST_F(Decoder, ACountOfFramesIsBelievedWhereItIsOne) {
  Film("a.avi", "-c:v mjpeg");
  EXPECT_EQ(VideoDecoder(Path("a.avi")).PromisedFrames(), 10u);
  // The stream's length in an AVI.
  ChangeBytes("a.avi", Find("a.avi", "strh") + 8 + 32, "\xff\xff\xff\x7f");
  EXPECT_EQ(VideoDecoder(Path("a.avi")).PromisedFrames(), std::nullopt);
  EXPECT_EQ(test::ReadAll(*OpenSequence(Path("a.avi"))).size(), 10u);
}

TEST_F(Decoder, SoundAndCoverArtAreNoVideo) {
  Ffmpeg("-f lavfi -i sine -t 1 -c:a aac sound.m4a");
  Ffmpeg("-f lavfi -i color=red:size=64x64 -frames:v 1 cover.png");
  Ffmpeg("-i sound.m4a -i cover.png -map 0 -map 1 -c copy -disposition:v attached_pic song.m4a");
  for (const char* name : {"sound.m4a", "song.m4a"}) {
    EXPECT_THAT([&] { OpenSequence(Path(name)); },
                ThrowsMessage<Error>(AllOf(HasSubstr(name), HasSubstr("no video in it"))));
  }
  Film("film.mp4", "-c:v mpeg4");
  Ffmpeg(
      "-i cover.png -i film.mp4 -i sound.m4a -map 0 -map 1 -map 2 -c copy "
      "-disposition:v:0 attached_pic film_with_cover.mp4");
  ExpectEqual(Pictures("film_with_cover.mp4"), Pictures("film.mp4"));
}

TEST_F(Decoder, ClosesWhatItOpens) {
  Film("a.mp4", "-c:v mpeg4");
  WriteBytes(Path("no.mp4"), "no video");
  const auto descriptors = [] {
    return std::distance(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator());
  };
  const auto before = descriptors();
  const auto clip = OpenSequence(Path("a.mp4"));
  for (int i = 0; i < 200; ++i) {
    VideoDecoder video(Path("a.mp4"));
    EXPECT_TRUE(video.Next());
    clip->Rewind();
    EXPECT_ANY_THROW(VideoDecoder(Path("no.mp4")));
  }
  EXPECT_EQ(descriptors(), before + 1);
}

// The descriptor of this process that reads the file.
int DescriptorOf(const std::string& file) {
  std::error_code gone;  // that of the folder itself
  for (const auto& entry : fs::directory_iterator("/proc/self/fd")) {
    if (fs::read_symlink(entry.path(), gone) == file) {
      return std::stoi(entry.path().filename().string());
    }
  }
  return -1;
}

// It may be whole: it must not seem to be a shorter one. A descriptor that is not for reading
// stands in for a bad disk.
TEST_F(Decoder, AVideoThatTheSystemDoesNotGiveIsAnError) {
  for (const char* name : {"a.avi", "a.mkv"}) {
    Film(name, "-c:v mjpeg -q:v 1", "null", "640x480");
    ASSERT_GT(fs::file_size(Path(name)), 10u << 16);  // more than FFmpeg reads at once
    VideoDecoder video(Path(name));
    ASSERT_TRUE(video.Next());
    const int descriptor = DescriptorOf(Path(name));
    ASSERT_GE(descriptor, 0);
    const int unreadable = open("/dev/null", O_WRONLY);
    ASSERT_EQ(dup2(unreadable, descriptor), descriptor);
    close(unreadable);
    EXPECT_THAT(
        [&] {
          while (video.Next()) {
          }
        },
        ThrowsMessage<SystemError>(AllOf(HasSubstr(name), HasSubstr("Bad file descriptor"))));
  }
  fs::create_symlink("/proc/self/mem", Path("b.mp4"));  // its first byte is an EIO
  EXPECT_THAT([&] { VideoDecoder video(Path("b.mp4")); },
              ThrowsMessage<SystemError>(AllOf(HasSubstr("b.mp4"), HasSubstr("Input/output"))));
}

}  // namespace
}  // namespace cohort
