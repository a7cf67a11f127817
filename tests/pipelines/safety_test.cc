// What the program promises whoever wrote its input: nothing is written outside the output folder,
// no shell runs, nothing is connected to, and what lies of its size costs no memory. The program
// runs under strace, with names and links that would lead it astray.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "frontend/storage/output.h"
#include "frontend/tracks/track_store.h"
#include "tests/support/program.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using Words = std::vector<std::string>;

bool Has(const char* program) {
  return test::RunShell(fmt::format("command -v {}", program)).exit_code == 0;
}

// As one word of a shell's line.
std::string Quoted(const std::string& word) {
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::string Line(const Words& words) {
  std::string line;
  for (const std::string& word : words) line += Quoted(word) + " ";
  return line;
}

// ---- what strace writes ----

// A text at `at`, behind its quote or bracket `end`, with the escapes undone; moves behind it.
std::string Unescaped(const std::string& line, std::size_t& at, char end) {
  std::string text;
  for (; at < line.size() && line[at] != end; ++at) {
    if (line[at] != '\\') {
      text += line[at];
      continue;
    }
    const char c = line[++at];
    if (c >= '0' && c <= '7') {
      int value = 0;
      for (int digits = 0; digits < 3 && line[at] >= '0' && line[at] <= '7'; ++digits, ++at) {
        value = 8 * value + (line[at] - '0');
      }
      --at;
      text += static_cast<char>(value);
    } else {
      constexpr std::string_view kNames = "ntrvfab";
      constexpr std::string_view kBytes = "\n\t\r\v\f\a\b";
      const std::size_t i = kNames.find(c);
      text += i == std::string_view::npos ? c : kBytes[i];
    }
  }
  ++at;
  return text;
}

struct Call {
  std::string name;
  std::string line;
  Words texts;         // quoted arguments, in order
  Words folders;       // of descriptors: where relative texts begin
  std::string opened;  // what the kernel has opened: behind all links
};

Call ParseCall(const std::string& line) {
  Call call;
  call.line = line;
  const std::size_t name = line.find(' ') + 1;  // behind the process
  std::size_t at = line.find('(', name);
  if (at == std::string::npos) return call;
  call.name =
      line.substr(line.find_first_not_of(' ', name), at - line.find_first_not_of(' ', name));
  bool returned = false;
  while (at < line.size()) {
    const char c = line[at++];
    if (c == '"') {
      call.texts.push_back(Unescaped(line, at, '"'));
    } else if (c == '<') {
      (returned ? call.opened : call.folders.emplace_back()) = Unescaped(line, at, '>');
    } else if (line.compare(at - 1, 4, ") = ") == 0) {
      returned = true;
    }
  }
  return call;
}

struct Trace {
  test::ProgramEnd end;
  std::vector<Call> calls;  // that had success
};

// ---- the tests ----

// What a name may be, and what a shell, FFmpeg, a page, or COLMAP would make of it.
const std::string kName = "-i;touch pwned;$(touch pwned)`touch pwned`%d&'\"<script>alert(1)<";

class Safety : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    dir_ = new test::TempDir;
    for (const char* name : {"in", "in/victim_folder", "out", "home", "tmp", "here"}) {
      fs::create_directory(*dir_ / name);
    }
    WriteBytes(In("victim"), "precious");
    WriteBytes(In("victim_folder/a"), "precious");
    const auto run = [](const Words& words) {
      const test::ProgramEnd end = Run(words);
      ASSERT_EQ(end.exit_code, 0) << fmt::format("{}", fmt::join(words, " ")) << "\n" << end.err;
    };
    run({"synth",
         In("clip"),
         "--motion",
         "lateral",
         "--frames",
         "8",
         "--width-px",
         "160",
         "--height-px",
         "120",
         "--focal-px",
         "130",
         "--quiet"});
    fs::create_directory(In(kName));
    for (int i = 0; i < 8; ++i) {
      fs::copy_file(In(fmt::format("clip/rgb/{:06}.png", i)),
                    In(kName) / fmt::format("{}{}.png", i, kName));
    }
    run({"track", In("clip"), "--features", "40", "--quiet", "--out", In("a.tracks")});
    run({"reconstruct", In("a.tracks"), "--quiet", "--out", In("model")});
    run({"export",
         In("a.tracks"),
         "--csv",
         In("a.csv"),
         "--npz",
         In("a.npz"),
         "--opensfm",
         In("a_opensfm.csv"),
         "--colmap-database",
         In("a.db"),
         "--quiet"});
    if (Has("ffmpeg")) {
      const test::ProgramEnd video =
          test::RunShell(fmt::format("ffmpeg -v error -i {}/%06d.png -pix_fmt yuv420p {}",
                                     In("clip/rgb").string(),
                                     In("real.mp4").string()));
      ASSERT_EQ(video.exit_code, 0) << video.err;
    }
  }
  static void TearDownTestSuite() {
    delete dir_;
    dir_ = nullptr;
  }

  static fs::path In(const std::string& name) { return *dir_ / "in" / name; }
  static fs::path Out(const std::string& name) { return *dir_ / "out" / name; }

  static std::string Environment() {
    return fmt::format("cd {} && HOME={} TMPDIR={} ",
                       (*dir_ / "here").string(),
                       (*dir_ / "home").string(),
                       (*dir_ / "tmp").string());
  }
  static test::ProgramEnd Run(const Words& words) {
    return test::RunShell(Environment() + test::ProgramPath() + " " + Line(words));
  }

  static Trace RunTraced(const Words& words) {
    const std::string log = *dir_ / "strace";
    Trace trace;
    trace.end = test::RunShell(
        Environment() + "strace -f -y -qq -s 8192 -o " + log +
        " -e trace=open,openat,openat2,creat,rename,renameat,renameat2,unlink,unlinkat,rmdir,mkdir,"
        "mkdirat,link,linkat,symlink,symlinkat,truncate,chmod,fchmodat,mknod,mknodat,chown,"
        "utimensat,"
        "execve,socket,connect,bind " +
        test::ProgramPath() + " " + Line(words));
    std::istringstream lines(ReadBytes(log));
    // A call that another process falls into is in two parts.
    std::map<std::string, std::string> begun;
    for (std::string line; std::getline(lines, line);) {
      constexpr std::string_view kUnfinished = " <unfinished ...>";
      const std::string process = line.substr(0, line.find(' '));
      if (line.ends_with(kUnfinished)) {
        begun[process] = line.substr(0, line.size() - kUnfinished.size());
        continue;
      }
      constexpr std::string_view kResumed = " resumed>";
      const std::size_t resumed = line.find(kResumed);
      if (resumed != std::string::npos && line.find("<... ") < resumed) {
        line = begun[process] + line.substr(resumed + kResumed.size());
        const std::size_t end = line.rfind(')', line.rfind("= "));  // between them are blanks
        line.replace(end, line.rfind("= ") - end, ") ");
      }
      Call call = ParseCall(line);
      const bool failed = line.find(") = -1 ") != std::string::npos && call.name != "connect" &&
                          call.name != "execve" && call.name != "socket";
      if (!call.name.empty() && !failed) trace.calls.push_back(std::move(call));
    }
    return trace;
  }

  // Of what lies in a folder: its kind, size, time and text.
  static std::map<std::string, std::string> Snapshot(const fs::path& folder) {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      struct stat status {};
      lstat(entry.path().c_str(), &status);
      files[entry.path().string()] =
          fmt::format("{} {} {}.{} {}",
                      status.st_mode,
                      S_ISREG(status.st_mode) ? status.st_size : 0,
                      S_ISREG(status.st_mode) ? status.st_mtim.tv_sec : 0,
                      S_ISREG(status.st_mode) ? status.st_mtim.tv_nsec : 0,
                      S_ISREG(status.st_mode) ? ReadBytes(entry.path()) : "");
    }
    return files;
  }

  // Everything that a call makes, changes or takes away lies in the output folder, or is a private
  // temporary; nothing but the programs that are known to run is run; no socket leads anywhere.
  static void ExpectHarmless(const Trace& trace) {
    const std::string out = (*dir_ / "out").string() + "/";
    const std::string temporary = (*dir_ / "tmp").string() + "/";
    const std::set<std::string> programs{"cohort", "colmap", "ffmpeg"};
    bool ran = false;
    for (const Call& call : trace.calls) {
      if (call.name == "execve") {
        ran = true;
        EXPECT_TRUE(programs.contains(fs::path(call.texts.front()).filename().string()))
            << call.line;
        continue;
      }
      if (call.name == "socket") {
        EXPECT_THAT(call.line, HasSubstr("(AF_UNIX, ")) << "no network";
        continue;
      }
      if (call.name == "connect" || call.name == "bind") {
        // The name service's cache, of who asks who the user is.
        EXPECT_THAT(call.line, HasSubstr("sun_path=\"/var/run/nscd/socket\"")) << "no network";
        continue;
      }
      const bool opens = call.name.starts_with("open") || call.name == "creat";
      if (opens && call.line.find("O_WRONLY") == std::string::npos &&
          call.line.find("O_RDWR") == std::string::npos &&
          call.line.find("O_CREAT") == std::string::npos &&
          call.line.find("O_TRUNC") == std::string::npos) {
        continue;  // to read
      }
      if (opens && (call.opened == "/dev/null" || call.opened.starts_with("/dev/null"))) continue;
      if (opens && call.line.find("O_TMPFILE") != std::string::npos) {
        EXPECT_THAT(call.line, HasSubstr("0600")) << "nobody else's";
        continue;
      }
      Words paths = call.texts;
      if (opens) paths = {call.opened};
      for (const std::string& text : paths) {
        const std::string begin =
            call.folders.empty() ? (*dir_ / "here").string() : call.folders.front();
        const std::string path = (fs::path(begin) / text).lexically_normal().string();
        if (path.starts_with(temporary)) {
          EXPECT_TRUE(!call.name.starts_with("mkdir") ||
                      call.line.find("0700") != std::string::npos)
              << call.line;
          continue;
        }
        EXPECT_TRUE(path.starts_with(out)) << call.line;
      }
    }
    EXPECT_TRUE(ran) << "strace saw nothing";
  }

  static test::TempDir* dir_;
};
test::TempDir* Safety::dir_ = nullptr;

// Before every command, links that lead out of the output folder lie in the place of all its
// outputs and of their partial files.
TEST_F(Safety, NothingIsWrittenOutsideTheOutputFolder) {
  if (!Has("strace")) GTEST_SKIP() << "no strace";
  const std::string clip = In(kName);
  struct Case {
    Words words;
    Words files;  // that it writes
    Words folders;
  };
  const auto out = [](const std::string& name) { return Out(kName + name).string(); };
  std::vector<Case> cases{
      {{"synth",
        out("synth"),
        "--frames",
        "3",
        "--width-px",
        "160",
        "--height-px",
        "120",
        "--focal-px",
        "130"},
       {},
       {"synth"}},
      {{"track", clip, "--features", "40", "--out", out("a.tracks"), "--json", out("a.json")},
       {"a.tracks", "a.json"},
       {}},
      {{"refine", In("a.tracks"), "--model", In("model"), "--out", out("b.tracks")},
       {"b.tracks"},
       {}},
      {{"refine", "--model", In("model"), "--images", In("clip"), "--out", out("refined")},
       {},
       {"refined"}},
      {{"reconstruct", In("a.tracks"), "--ceres.covariances", "--out", out("model")},
       {},
       {"model"}},
      {{"export",
        In("a.tracks"),
        "--csv",
        out("a.csv"),
        "--npz",
        out("a.npz"),
        "--opensfm",
        out("o.csv"),
        "--colmap-database",
        out("a.db"),
        "--covariances",
        out("c.npz"),
        "--model",
        In("model"),
        "--bal",
        out("bal.txt")},
       {"a.csv", "a.npz", "o.csv", "a.db", "c.npz", "bal.txt"},
       {}},
      {{"import", In("a.csv"), "--images", In("clip"), "--out", out("i.tracks")}, {"i.tracks"}, {}},
      {{"import", In("a.npz"), "--images", In("clip"), "--out", out("i.tracks")}, {"i.tracks"}, {}},
      {{"import", In("a_opensfm.csv"), "--images", In("clip"), "--out", out("i.tracks")},
       {"i.tracks"},
       {}},
      {{"import", In("a.db"), "--images", In("clip"), "--out", out("i.tracks")}, {"i.tracks"}, {}},
      {{"import", In("model"), "--images", In("clip"), "--out", out("i.tracks")}, {"i.tracks"}, {}},
      {{"evaluate", In("model"), "--truth", In("clip"), "--json", out("e.json")}, {"e.json"}, {}},
      {{"show", In("a.tracks"), "--model", In("model"), "--out", out("p.html")}, {"p.html"}, {}},
      {{"show", In("a.tracks"), "--out", out("v.mp4")}, {"v.mp4"}, {}},
      {{"degrade", clip, out("dark"), "--level", "hard"}, {}, {"dark"}},
      {{"sfm", clip, "--camera", "130,130,79.5,59.5", "--features", "40", "--out", out("scene")},
       {},
       {}},
      {{"compare",
        clip,
        "--levels",
        "hard",
        "--trackers",
        "klt",
        "--backends",
        "ceres",
        "--frames",
        "0:6",
        "--out",
        out("grid")},
       {},
       {}}};
  if (Has("ffmpeg")) {
    cases.push_back({{"show", In("a.tracks"), "--out", out("v.gif")}, {"v.gif"}, {}});
    cases.push_back(
        {{"degrade", clip, out("phone"), "--level", "hard", "--recipe", "phone"}, {}, {"phone"}});
  }
  if (Has("colmap")) {
    cases.push_back(
        {{"reconstruct", In("a.tracks"), "--backend", "colmap", "--out", out("by_colmap")},
         {},
         {"by_colmap"}});
  }
  const auto before = Snapshot(*dir_ / "in");
  for (Case& a_case : cases) {
    const std::string what = fmt::format("{}", fmt::join(a_case.words, " "));
    SCOPED_TRACE(what);
    for (const std::string& file : a_case.files) {
      for (const char* suffix : {"", ".partial", ".partial-journal", ".partial.mp4"}) {
        fs::remove_all(out(file + suffix));
        fs::create_symlink(In("victim"), out(file + suffix));
      }
    }
    for (const std::string& folder : a_case.folders) {
      fs::remove_all(out(folder));
      fs::create_directory_symlink(In("victim_folder"), out(folder + ".partial"));
    }
    a_case.words.emplace_back("--quiet");
    const Trace trace = RunTraced(a_case.words);
    EXPECT_EQ(trace.end.exit_code, 0) << trace.end.err;
    ExpectHarmless(trace);
    EXPECT_EQ(Snapshot(*dir_ / "in"), before) << "the input is as it was";
    EXPECT_TRUE(fs::is_empty(*dir_ / "here"));
    EXPECT_TRUE(fs::is_empty(*dir_ / "home"));
    EXPECT_TRUE(fs::is_empty(*dir_ / "tmp"));
    for (const std::string& file : a_case.files) {
      EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(out(file)))) << file;
    }
    for (const std::string& folder : a_case.folders) {
      EXPECT_TRUE(fs::is_directory(fs::symlink_status(out(folder)))) << folder;
    }
  }
}

// What an earlier run has left in the output folder may be anybody's, too: a grid's folder may be
// shared.
TEST_F(Safety, NoLogOrLockIsWrittenThroughALink) {
  if (!Has("strace")) GTEST_SKIP() << "no strace";
  fs::create_directories(Out("shared/cells"));
  for (const char* name : {"clip0.json.log", "results.lock", "clip0.json.partial"}) {
    fs::create_symlink(In("victim"), Out("shared/cells") / name);
  }
  const auto before = Snapshot(*dir_ / "in");
  const Trace trace = RunTraced({"compare",
                                 In("clip"),
                                 "--trackers",
                                 "klt",
                                 "--backends",
                                 "ceres",
                                 "--frames",
                                 "0:4",
                                 "--out",
                                 Out("shared"),
                                 "--resume",
                                 "--quiet"});
  EXPECT_EQ(trace.end.exit_code, 1);
  EXPECT_THAT(trace.end.err, HasSubstr("results.lock"));
  ExpectHarmless(trace);
  EXPECT_EQ(Snapshot(*dir_ / "in"), before);
}

TEST_F(Safety, TheNameOfAVideoIsNoMoreThanAName) {
  if (!Has("strace") || !Has("ffmpeg")) GTEST_SKIP() << "no strace, or no ffmpeg";
  const fs::path here = *dir_ / "here";
  const Words names{"-i",
                    "concat:real.mp4|real.mp4",
                    "http:x.mp4",
                    "tcp:127.0.0.1:9",
                    kName,
                    "a%d.mp4",
                    "pipe:0",
                    "rtsp:a",
                    "udp:127.0.0.1:9"};
  for (const std::string& name : names) {
    SCOPED_TRACE(name);
    fs::copy_file(In("real.mp4"), here / name);
    const Trace trace = RunTraced({"track",
                                   "--layout=video",
                                   "--features=40",
                                   "--quiet",
                                   "--out=" + Out("video.tracks").string(),
                                   name.starts_with("-") ? "./" + name : name});
    EXPECT_EQ(trace.end.exit_code, 0) << trace.end.err;
    ExpectHarmless(trace);
    fs::remove(here / name);
    EXPECT_TRUE(fs::is_empty(here));
  }
  for (const char* missing : {"http://127.0.0.1:9/x.mp4",
                              "file:///etc/passwd",
                              "tcp://127.0.0.1:9",
                              "concat:/etc/passwd|/etc/passwd"}) {
    SCOPED_TRACE(missing);
    const Trace trace =
        RunTraced({"track", missing, "--layout", "video", "--quiet", "--out", Out("video.tracks")});
    EXPECT_EQ(trace.end.exit_code, 1);
    EXPECT_THAT(trace.end.err, HasSubstr("no such file"));
    ExpectHarmless(trace);
  }
}

// Names out of a file reach no terminal as codes.
TEST_F(Safety, WhatIsPrintedIsText) {
  TrackFile file = ReadTrackFile(In("a.tracks"));
  file.image_root = "/tmp/x\x1b]0;pwned\x07\nsecond line";
  WriteTrackFile(Out("coded.tracks"), file);
  const test::ProgramEnd end =
      Run({"export", Out("coded.tracks"), "--colmap-database", Out("coded.db"), "--quiet"});
  EXPECT_EQ(end.exit_code, 0) << end.err;
  EXPECT_EQ(end.out,
            Out("coded.db").string() +
                ": for COLMAP with --image_path "
                "/tmp/x ]0;pwned  second line\n");
}

// Names in bytes that are no UTF-8 are names like others.
TEST_F(Safety, ANameNeedNotBeText) {
  const std::string tracks = Out("b\xff\xfe.tracks");
  fs::copy_file(In("a.tracks"), tracks);
  test::ProgramEnd end = Run({"reconstruct", tracks, "--out", Out("m\xff"), "--quiet"});
  EXPECT_EQ(end.exit_code, 0) << end.err;
  fs::create_directory_symlink(In("clip"), Out("c\xff"));
  end = Run({"compare",
             Out("c\xff"),
             "--trackers",
             "klt",
             "--backends",
             "ceres",
             "--frames",
             "0:4",
             "--out",
             Out("g\xff"),
             "--quiet"});
  EXPECT_EQ(end.exit_code, 0) << end.err;
}

// ---- what lies ----

std::string BigEndian(std::uint32_t value) {
  std::string text;
  for (int shift = 24; shift >= 0; shift -= 8) text += static_cast<char>(value >> shift & 0xFF);
  return text;
}

// One line, in time, of 2 GB at most.
void ExpectOneLine(const std::string& environment, const Words& words) {
  SCOPED_TRACE(fmt::format("{}", fmt::join(words, " ")));
  const test::ProgramEnd end = test::RunShell(fmt::format("{} ulimit -v 2000000; timeout 60 {} {}",
                                                          environment + "true;",
                                                          test::ProgramPath(),
                                                          Line(words)));
  EXPECT_EQ(end.exit_code, 1) << end.err;
  EXPECT_TRUE(end.err.starts_with("cohort: error: ")) << end.err;
  EXPECT_EQ(end.err.find('\n'), end.err.size() - 1) << end.err;
  EXPECT_THAT(end.err, Not(HasSubstr("internal")));
}

TEST_F(Safety, WhatLiesOfItsSizeIsOneLineInTwoGigabytes) {
  test::ProgramEnd honest = test::RunShell(
      Environment() + "ulimit -v 2000000; " + test::ProgramPath() + " " +
      Line({"track", In("clip"), "--features", "40", "--quiet", "--out", Out("honest.tracks")}));
  ASSERT_EQ(honest.exit_code, 0) << "there is room for what is no lie: " << honest.err;

  // 1 TB that takes no room on the disk.
  const auto sparse = [](const fs::path& path) {
    fs::create_directories(path.parent_path());
    WriteBytes(path, "");
    fs::resize_file(path, std::uintmax_t{1} << 40);
    return path.string();
  };
  const std::string clip = In("clip");
  const std::string out = Out("lies.tracks");
  const std::string env = Environment();
  ExpectOneLine(env, {"track", sparse(Out("1tb/a.mp4")), "--out", out});
  ExpectOneLine(env, {"track", sparse(Out("1tb_pictures/a.png")), "--out", out});
  ExpectOneLine(env, {"track", clip, "--config", sparse(Out("1tb/a.json")), "--out", out});
  ExpectOneLine(env, {"track", clip, "--mask", sparse(Out("1tb/m.png")), "--out", out});
  for (const char* form : {"csv", "npz", "opensfm", "colmap"}) {
    ExpectOneLine(env,
                  {"import", sparse(Out("1tb/a")), "--from", form, "--images", clip, "--out", out});
  }
  ExpectOneLine(env, {"export", sparse(Out("1tb/a.tracks")), "--csv", Out("lies.csv")});
  for (const char* ending : {".bin", ".txt"}) {
    for (const char* name : {"cameras", "images", "points3D"}) {
      sparse(Out(fmt::format("1tb_model{}/{}{}", ending, name, ending)));
    }
    ExpectOneLine(env, {"evaluate", Out(fmt::format("1tb_model{}", ending)), "--truth", clip});
  }
  for (const char* name : {"rgb.txt", "groundtruth.txt", "calibration.txt", "depth.txt"}) {
    const fs::path folder = Out(std::string("1tb_") + name);
    fs::copy(clip, folder, fs::copy_options::recursive);
    sparse(folder / name);
    ExpectOneLine(env, {"track", folder, "--out", out});
  }

  // Pictures of a few bytes with headers of many pixels.
  const std::string png = "\x89PNG\r\n\x1a\n" + BigEndian(13) + "IHDR";
  const std::map<std::string, std::string> pictures{
      {"a.png",
       png + BigEndian(0x7FFFFFFF) + BigEndian(0x7FFFFFFF) + std::string("\x08\0\0\0\0", 5)},
      {"b.pgm", "P5 1048576 1024 65535\n"},
      {"c.ppm", "P6 99999999999 99999999999 255\n"},
      {"d.bmp",
       "BM" + std::string(8, '\0') +
           std::string("\x36\0\0\0\x28\0\0\0\xFF\xFF\x0F\0\xE8\x03\0\0"
                       "\x01\0\x18\0",
                       20) +
           std::string(24, '\0')}};
  for (const auto& [name, bytes] : pictures) {
    fs::create_directory(Out(name));
    WriteBytes(Out(name) / name, bytes);
    ExpectOneLine(env, {"track", Out(name), "--out", out});
  }

  // Nested without end.
  WriteBytes(Out("deep.json"), std::string(1'000'000, '['));
  ExpectOneLine(env, {"track", clip, "--config", Out("deep.json"), "--out", out});
  std::string line = "track_id,frame,x,y\n";
  line += std::string(8'000'000, '1');
  WriteBytes(Out("long.csv"), line);
  ExpectOneLine(env, {"import", Out("long.csv"), "--images", clip, "--out", out});

  // A model says of itself how many frames it was to have.
  for (const char* range : {"0:4294967295", "0:4294967295:4294967294", "5:1", "-"}) {
    fs::remove_all(Out("claims"));
    fs::copy(In("model"), Out("claims"));
    WriteBytes(Out("claims") / "summary.json", fmt::format("{{\"frame_range\": \"{}\"}}", range));
    if (std::string_view(range).ends_with("4294967294")) {  // two frames, far apart
      EXPECT_EQ(Run({"evaluate", Out("claims"), "--truth", clip, "--quiet"}).exit_code, 0);
    } else {
      ExpectOneLine(env, {"evaluate", Out("claims"), "--truth", clip});
    }
  }
  constexpr const char* kNoList = R"({"registered": 1, "frames": 1, "points": 1, "reasons": 5})";
  const std::string deep = R"({"registered": 1, "frames": 1, "points": )" +
                           std::string(80'000, '[') + std::string(80'000, ']') + "}";
  for (const std::string& summary :
       {std::string("7"), std::string("[]"), std::string("{}"), std::string(kNoList), deep}) {
    WriteBytes(Out("claims") / "summary.json", summary);
    ExpectOneLine(env,
                  {"show", In("a.tracks"), "--model", Out("claims"), "--out", Out("lies.html")});
  }
}

TEST_F(Safety, NothingIsWaitedForAndNothingReadWithoutEnd) {
  const std::string clip = In("clip");
  const std::string out = Out("never.tracks");
  const std::string env = Environment();
  const std::string pipe = Out("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& input : {pipe, std::string("/dev/zero"), In("victim_folder").string()}) {
    ExpectOneLine(env, {"track", input, "--layout", "video", "--out", out});
    ExpectOneLine(env, {"track", clip, "--config", input, "--out", out});
    ExpectOneLine(env, {"track", clip, "--mask", input, "--out", out});
    for (const char* form : {"csv", "npz", "opensfm", "colmap"}) {
      ExpectOneLine(env, {"import", input, "--from", form, "--images", clip, "--out", out});
    }
    ExpectOneLine(env, {"export", input, "--csv", Out("never.csv")});
    ExpectOneLine(env, {"reconstruct", input, "--out", Out("never")});
    ExpectOneLine(env, {"evaluate", input, "--truth", clip});
  }
}

// What libpng, libjpeg and libtiff say of it themselves is not among our lines.
TEST_F(Safety, ADamagedPictureIsOneLine) {
  fs::create_directory(Out("hurt"));
  std::string bytes = ReadBytes(In("clip/rgb/000000.png"));
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 0x55);
  WriteBytes(Out("hurt") / "0.png", bytes);
  ExpectOneLine(Environment(), {"track", Out("hurt"), "--out", Out("hurt.tracks")});
}

}  // namespace
}  // namespace cohort
