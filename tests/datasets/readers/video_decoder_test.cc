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

  struct Output {
    std::string name;
    std::string codec;
    std::string filters = "null";
  };
  // Files of one source, by one run of the program, as it takes long to start.
  void FilmFrom(const std::string& source, const std::vector<Output>& files) const {
    std::string outputs;
    for (const Output& file : files) {
      outputs += fmt::format(
          "-vf \"{}\" -fps_mode passthrough {} {} ", file.filters, file.codec, file.name);
    }
    Ffmpeg("-f lavfi -i " + source + " " + outputs);
  }

  // Files of the same ten noisy frames at 25 Hz.
  void Films(const std::vector<Output>& files, const char* size = "160x120") const {
    FilmFrom(
        fmt::format("testsrc2=size={}:rate=25:duration=0.4,noise=alls=20:allf=t:all_seed=1", size),
        files);
  }
  void Film(const std::string& name,
            const std::string& codec,
            const std::string& filters = "null",
            const char* size = "160x120") const {
    Films({{name, codec, filters}}, size);
  }

  // What the program makes of files, which turns them as they say: all by one run.
  struct OfFfmpeg {
    std::string name;
    cv::Size size;
    std::string filters = "null";
  };
  std::vector<std::vector<cv::Mat>> PicturesOfFfmpeg(const std::vector<OfFfmpeg>& files) const {
    std::string inputs;
    std::string outputs;
    for (std::size_t i = 0; i < files.size(); ++i) {
      inputs += "-i " + files[i].name + " ";
      outputs += fmt::format(
          "-map {0}:v -fps_mode passthrough -sws_flags bicubic -vf {1} -pix_fmt bgr24 "
          "-f rawvideo raw{0} ",
          i,
          files[i].filters);
    }
    Ffmpeg(inputs + outputs);
    std::vector<std::vector<cv::Mat>> pictures(files.size());
    for (std::size_t i = 0; i < files.size(); ++i) {
      std::string bytes = ReadBytes(Path(fmt::format("raw{}", i)));
      const std::size_t one = static_cast<std::size_t>(files[i].size.area()) * 3;
      EXPECT_EQ(bytes.size() % one, 0u);
      for (std::size_t at = 0; at + one <= bytes.size(); at += one) {
        pictures[i].push_back(cv::Mat(files[i].size, CV_8UC3, bytes.data() + at).clone());
      }
    }
    return pictures;
  }

  std::vector<cv::Mat> PicturesOfFfmpeg(const std::string& name,
                                        cv::Size size,
                                        const std::string& filters = "null") const {
    return PicturesOfFfmpeg({{name, size, filters}}).front();
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

  // Files of 24 fields, of each of which a frame gets every other row. They move by 3 px.
  void FilmFields(const std::vector<Output>& files) const {
    FilmFrom("testsrc2=size=160x120:rate=50:duration=0.02,loop=23:1,scroll=h=0.02", files);
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
  Films({{"opaque.mov", "-c:v qtrle", cut + "255'"},
         {"cut.mov", "-c:v qtrle", cut + "255*gte(X,40)'"}});
  EXPECT_EQ(Pictures("opaque.mov").front().type(), CV_8UC3) << "there is nothing to mask";
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
  std::vector<OfFfmpeg> of_ffmpeg;
  for (const auto& [name, codec] : files) {
    of_ffmpeg.push_back({name, codec.starts_with(odd) ? cv::Size(161, 121) : cv::Size(164, 124)});
  }
  const auto expected = PicturesOfFfmpeg(of_ffmpeg);
  for (std::size_t i = 0; i < files.size(); ++i) {
    SCOPED_TRACE(files[i].first);
    EXPECT_EQ(expected[i].size(), 10u);
    ExpectEqual(Pictures(files[i].first), expected[i]);
  }
}

// FFmpeg takes what states no matrix as BT.601, in HD too.
TEST_F(Decoder, ColoursAreThoseOfTheProgramFfmpeg) {
  const std::string deep = "-c:v libx265 -preset ultrafast -x265-params log-level=0 -pix_fmt ";
  const std::string h264 = "-c:v libx264 -preset ultrafast -pix_fmt ";
  std::string outputs;
  std::vector<OfFfmpeg> files;
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
        files.push_back({fmt::format("{}.mp4", files.size()), {162, 122}});
        outputs += fmt::format(
            "-colorspace {} -color_range {} {} {} ", matrix, range, codec, files.back().name);
      }
    }
  }
  Ffmpeg("-f lavfi -i testsrc2=size=162x122:rate=25:duration=0.08 " + outputs);
  Ffmpeg("-f lavfi -i testsrc2=size=1280x720:rate=25:duration=0.08 " + h264 + "yuv420p hd.mp4");
  files.push_back({"hd.mp4", {1280, 720}});
  const auto expected = PicturesOfFfmpeg(files);
  for (std::size_t i = 0; i < files.size(); ++i) {
    SCOPED_TRACE(files[i].name);
    const std::vector<cv::Mat> pictures = Pictures(files[i].name);
    ExpectEqual(pictures, expected[i]);
    ExpectEqual(ColorsOfSequence(files[i].name), pictures);
  }
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
  const std::vector<std::pair<std::string, std::string>> kinds{{"HLG", "arib-std-b67"},
                                                               {"PQ", "smpte2084"}};
  std::string outputs;
  std::string bare;  // states the transfer alone, in odd sizes and other pixels
  std::vector<OfFfmpeg> of_ffmpeg;
  for (const auto& [kind, transfer] : kinds) {
    outputs += fmt::format(
        "-vf zscale=tin=iec61966-2-1:pin=bt709:t={0}:p=bt2020:m=bt2020nc:r=tv:npl=203,"
        "format=yuv420p10le -color_primaries bt2020 -color_trc {0} -colorspace bt2020nc "
        "-color_range tv {1} {2}.mp4 ",
        transfer,
        hevc,
        kind);
    bare += fmt::format(
        "-map {} -vf scale=161:121,format=yuv422p10le,setparams=colorspace=unknown:"
        "color_primaries=unknown -color_trc {} -colorspace unknown -color_primaries unknown "
        "-c:v ffv1 {}_bare.mkv ",
        of_ffmpeg.size(),
        transfer,
        kind);
    of_ffmpeg.push_back({kind + ".mp4", {160, 120}, kToneMapping});
  }
  Ffmpeg("-f lavfi -i smptehdbars=size=160x120:rate=25:duration=0.2,format=gbrp " + outputs);
  Ffmpeg("-i HLG.mp4 -i PQ.mp4 " + bare);
  const auto expected = PicturesOfFfmpeg(of_ffmpeg);
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    const std::string& kind = kinds[i].first;
    const std::string& name = of_ffmpeg[i].name;
    SCOPED_TRACE(kind);
    const std::vector<cv::Mat> pictures = Pictures(name);
    EXPECT_EQ(pictures.size(), 5u);
    ExpectEqual(pictures, expected[i]);
    // What is not near white is as it was filmed.
    const cv::Rect yellow(42, 10, 8, 40);
    const cv::Scalar color = cv::mean(pictures.at(0)(yellow));
    EXPECT_NEAR(color[0], 0, 6);
    EXPECT_NEAR(color[1], 191, 6);
    EXPECT_NEAR(color[2], 191, 6);

    const auto clip = OpenSequence(Path(name));
    EXPECT_THAT(
        clip->Warning(),
        AllOf(HasSubstr(name + " is HDR video"), HasSubstr(kind), HasSubstr("tone-mapped")));
    const std::vector<Frame> frames = test::ReadAll(*clip);
    ASSERT_EQ(frames.size(), 5u);
    EXPECT_EQ(cv::norm(frames[3].color, pictures[3], cv::NORM_INF), 0);
    cv::Mat gray;
    cv::cvtColor(pictures[3], gray, cv::COLOR_BGR2GRAY);
    EXPECT_EQ(cv::norm(frames[3].gray, gray, cv::NORM_INF), 0);

    EXPECT_EQ(ColorsOfSequence(kind + "_bare.mkv").size(), 5u);
  }
  // SDR in BT.2020 is not HDR.
  Film("sdr.mp4", "-c:v libx264 -color_primaries bt2020 -color_trc bt2020-10 -colorspace bt2020nc");
  EXPECT_EQ(OpenSequence(Path("sdr.mp4"))->Warning(), "");
}

struct Fields {
  std::string name;
  std::string codec;
  bool is_top;  // the first field
  std::string after = "null";
  bool flagged = true;
};

TEST_F(Decoder, InterlacedFramesAreDeinterlaced) {
  const std::string plain = "-c:v libx264 -crf 10";
  const std::string fields_of = plain + " -flags +ilme+ildct -x264opts ";
  const std::vector<Fields> files{
      {"top.mts", fields_of + "tff=1", true},
      {"bottom.mp4", fields_of + "bff=1", false},
      {"dvd.mpg", "-c:v mpeg2video -q:v 2 -flags +ilme+ildct", true},
      {"container.mov", "-c:v rawvideo -pix_fmt uyvy422 -field_order tt", true},
      // A wrong flag does not count.
      {"wrong.mp4", fields_of + "bff=1", true},
      {"plain_top.mp4", plain, true, "setfield=prog", false},
      {"plain_bottom.mkv", plain, false, "setfield=prog", false}};
  std::vector<Output> films;
  std::vector<OfFfmpeg> of_ffmpeg;
  for (const Fields& fields : files) {
    films.push_back(
        {fields.name,
         fields.codec,
         fmt::format(
             "tinterlace=interleave_{},{}", fields.is_top ? "top" : "bottom", fields.after)});
    of_ffmpeg.push_back({fields.name,
                         {160, 120},
                         fmt::format("{}bwdif=mode=send_frame:parity={}",
                                     fields.name == "container.mov" ? "format=yuv422p," : "",
                                     fields.is_top ? "tff" : "bff")});
  }
  FilmFields(films);
  const auto all_expected = PicturesOfFfmpeg(of_ffmpeg);
  for (std::size_t i = 0; i < files.size(); ++i) {
    const Fields& fields = files[i];
    SCOPED_TRACE(fields.name);
    const std::vector<cv::Mat>& expected = all_expected[i];
    ASSERT_EQ(expected.size(), 12u);
    ExpectEqual(ColorsOfSequence(fields.name), expected);
    const auto clip = OpenSequence(Path(fields.name));
    EXPECT_THAT(clip->Warning(),
                AllOf(HasSubstr(fields.name),
                      HasSubstr(fields.flagged ? " is interlaced, " : "does not state"),
                      HasSubstr(fields.is_top ? "top field first" : "bottom field first"),
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
  std::vector<Output> films;
  std::vector<OfFfmpeg> of_ffmpeg;
  for (const auto& [name, field, parity] :
       {std::tuple("top.mp4", "top", "tff"), std::tuple("bottom.mp4", "bottom", "bff")}) {
    films.push_back(
        {name,
         "-c:v libx264 -crf 10",
         fmt::format("fps=24,telecine=first_field={}:pattern=23,setfield=prog", field)});
    of_ffmpeg.push_back({name, {160, 120}, fmt::format("bwdif=mode=send_frame:parity={}", parity)});
  }
  FilmFields(films);
  const auto expected = PicturesOfFfmpeg(of_ffmpeg);
  for (std::size_t i = 0; i < films.size(); ++i) {
    SCOPED_TRACE(films[i].name);
    ExpectEqual(ColorsOfSequence(films[i].name), expected[i]);
  }
}

// Also those that are flagged as interlaced, as some cameras' are.
TEST_F(Decoder, ProgressiveFramesAreNotDeinterlaced) {
  const std::string plain = "-c:v libx264";
  const std::string flagged = plain + " -flags +ilme+ildct -x264opts tff=1";
  FilmFields({{"plain.mp4", plain, "null"}, {"flagged.mp4", flagged, "null"}});
  const auto expected = PicturesOfFfmpeg({{"plain.mp4", {160, 120}}, {"flagged.mp4", {160, 120}}});
  for (const auto& [name, pictures] :
       {std::pair("plain.mp4", expected[0]), std::pair("flagged.mp4", expected[1])}) {
    SCOPED_TRACE(name);
    EXPECT_EQ(OpenSequence(Path(name))->Warning(), "");
    ASSERT_EQ(pictures.size(), 24u);
    ExpectEqual(ColorsOfSequence(name), pictures);
  }
  // What does not move shows nothing: the flags decide.
  Ffmpeg(fmt::format(
      "-f lavfi -i color=gray:size=160x120:rate=25:duration=0.4 {} still.mp4 {} flagged_still.mp4",
      plain,
      flagged));
  for (const auto& [name, deinterlaced] :
       {std::pair("still.mp4", false), std::pair("flagged_still.mp4", true)}) {
    const std::string warning = OpenSequence(Path(name))->Warning();
    EXPECT_EQ(warning.find("deinterlaced") != std::string::npos, deinterlaced) << name;
  }
}

TEST_F(Decoder, AnInterlacedVideoMayBeShortOrChangeItsSize) {
  const std::string flags = "-c:v libx264 -flags +ilme+ildct -x264opts tff=1 ";
  Ffmpeg("-f lavfi -i testsrc2=size=160x120:rate=25:duration=0.04 " +
         ("-f lavfi -i testsrc2=size=320x240:rate=25:duration=0.4 -map 0 " + flags) +
         "one.h264 -map 1 " + flags + "other.h264");
  EXPECT_EQ(ColorsOfSequence("one.h264").size(), 1u);
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
  const std::vector<Turn> turns{{1, 0, 0, 1, RowOrder::kDown},
                                {0, 1, -1, 0, RowOrder::kLeft},
                                {-1, 0, 0, -1, RowOrder::kUp},
                                {0, -1, 1, 0, RowOrder::kRight},
                                // Mirrors, of a camera that looks at its user.
                                {-1, 0, 0, 1, RowOrder::kDown},
                                {1, 0, 0, -1, RowOrder::kUp},
                                {0, 1, 1, 0, RowOrder::kRight},
                                {0, -1, -1, 0, RowOrder::kLeft}};
  Film("a.mp4", "-c:v mpeg4");
  const std::size_t matrix = Find("a.mp4", "tkhd") + 44;
  std::vector<OfFfmpeg> files;
  for (const Turn& turn : turns) {
    std::string numbers;  // of 16.16 bits
    for (const int value : {turn.a, turn.b, 0, turn.c, turn.d}) {
      numbers += {static_cast<char>(value < 0 ? 255 : 0), static_cast<char>(value), 0, 0};
    }
    files.push_back({fmt::format("{}.mp4", files.size()),
                     turn.a == 0 ? cv::Size(120, 160) : cv::Size(160, 120)});
    fs::copy_file(Path("a.mp4"), Path(files.back().name));
    ChangeBytes(files.back().name, matrix, numbers);
  }
  const auto expected = PicturesOfFfmpeg(files);
  for (std::size_t i = 0; i < turns.size(); ++i) {
    const auto& [a, b, c, d, rows] = turns[i];
    SCOPED_TRACE(fmt::format("{} {} {} {}", a, b, c, d));
    ExpectEqual(Pictures(files[i].name), expected[i]);
    const auto clip = OpenSequence(Path(files[i].name));
    EXPECT_EQ(test::ReadAll(*clip)[0].gray.size(), files[i].size);
    EXPECT_EQ(clip->SensorRows(), rows);
  }
}

// As HDV, DV and DVDs store them.
TEST_F(Decoder, PixelsThatAreNotSquareAreMadeSo) {
  Films({{"hdv.mp4", "-c:v mpeg4", "setsar=4/3"}, {"dv.mkv", "-c:v mpeg4", "setsar=8/9"}});
  Ffmpeg(
      "-i hdv.mp4 -i dv.mkv "
      "-map 0 -vf scale=213:120:flags=bicubic,setsar=1 -c:v ffv1 -pix_fmt bgr24 hdv_square.mkv "
      "-map 1 -vf scale=142:120:flags=bicubic,setsar=1 -c:v ffv1 -pix_fmt bgr24 dv_square.mkv");
  const std::vector<OfFfmpeg> squares{{"hdv_square.mkv", {213, 120}},
                                      {"dv_square.mkv", {142, 120}}};
  const auto expected = PicturesOfFfmpeg(squares);
  for (std::size_t i = 0; i < squares.size(); ++i) {
    const std::string name = i == 0 ? "hdv.mp4" : "dv.mkv";
    const cv::Size size = squares[i].size;
    SCOPED_TRACE(name);
    ExpectEqual(Pictures(name), expected[i]);
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
  std::vector<Output> files;
  for (const char* aspect : {"1/1", "161/160", "8/1", "1/8"}) {
    files.push_back(
        {fmt::format("{}.mkv", files.size()), "-c:v ffv1", std::string("setsar=") + aspect});
  }
  Films(files);
  for (const Output& file : files) {
    const auto clip = OpenSequence(Path(file.name));
    EXPECT_EQ(test::ReadAll(*clip)[0].gray.size(), cv::Size(160, 120)) << file.filters;
    EXPECT_EQ(clip->Warning(), "") << file.filters;
  }
}

// Of Matroska only how long it is: a second of slack for the sound hid half of a short clip.
TEST_F(Decoder, AMatroskaThatIsCutShortIsToldToTheFrame) {
  const auto warning = [&](const std::string& name) {
    const auto clip = OpenSequence(Path(name));
    test::ReadAll(*clip);
    return clip->Warning();
  };
  Films({{"whole.mkv", "-c:v mpeg4 -g 1"},
         {"dark.mkv", "-c:v mpeg4", "select='not(between(n,3,7))'"}});
  EXPECT_EQ(warning("whole.mkv"), "");
  const std::string bytes = ReadBytes(Path("whole.mkv"));
  for (const double share : {0.3, 0.5, 0.7}) {
    WriteBytes(Path("cut.mkv"), bytes.substr(0, static_cast<std::size_t>(share * bytes.size())));
    EXPECT_THAT(warning("cut.mkv"), HasSubstr("truncated")) << share;
  }
  // Frames that were not exposed in time are none that are missing.
  EXPECT_EQ(warning("dark.mkv"), "");
}

TEST_F(Decoder, TimesAreTheFiles) {
  // A phone in the dark: frames 3 to 5 were not exposed in time.
  const std::string dark = "select='not(between(n,3,5))'";
  Films({{"a.mp4", "-c:v mpeg4", dark},
         {"late.mkv", "-c:v mpeg4 -output_ts_offset 3", dark},
         {"b_frames.mp4", "-c:v mpeg4 -bf 2"}});
  EXPECT_THAT(Milliseconds("a.mp4"), ElementsAre(0, 40, 80, 240, 280, 320, 360));
  // A clip that is cut out of another begins at 0 too.
  EXPECT_THAT(Milliseconds("late.mkv"), ElementsAre(0, 40, 80, 240, 280, 320, 360));
  // Frames that are stored out of order.
  EXPECT_THAT(Milliseconds("b_frames.mp4"),
              ElementsAre(0, 40, 80, 120, 160, 200, 240, 280, 320, 360));
}

TEST_F(Decoder, TimesThatAreMissingOrStandStillAreOfEvenFrames) {
  Films({{"bare.h264", "-c:v libx264 -bf 0"}, {"a.mp4", "-c:v mpeg4"}});
  Ffmpeg(
      "-i a.mp4 -c copy -bsf:v setts=ts=0 still.mkv "
      "-c copy -bsf:v \"setts=ts=if(gte(N\\,4)\\,120\\,N*40)\" stops.mkv");
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
  Films({{"a.h264", "-c:v libx264"},
         {"b.h264", "-c:v libx264", "scale=320:240"},
         {"c.h264", "-c:v libx264", "scale=64:48"}});
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
  std::string bytes = ReadBytes(Path("a.avi"));
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
  Ffmpeg(
      "-f lavfi -i sine=duration=1 -f lavfi -i color=red:size=64x64:rate=1:duration=1 "
      "-map 0 -c:a aac sound.m4a -map 1 cover.png");
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
