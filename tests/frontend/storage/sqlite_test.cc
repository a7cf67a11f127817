#include "frontend/storage/sqlite.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/stat.h>

#include <array>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <thread>

#include "frontend/core/error.h"
#include "frontend/storage/output.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using Mode = SqliteDatabase::Mode;

TEST(Sqlite, KeepsNullEmptyAndBytesApart) {
  const test::TempDir dir;
  auto db = SqliteDatabase::Open(dir / "a.db", Mode::kCreate);
  db.Execute("CREATE TABLE t(id INTEGER PRIMARY KEY, name TEXT, x REAL, data BLOB)");
  const std::array<std::byte, 3> bytes{std::byte{0}, std::byte{7}, std::byte{255}};
  auto insert = db.Prepare("INSERT INTO t VALUES(?, ?, ?, ?)");
  insert.Bind(1, std::int64_t{1}).Bind(2, "a'b").Bind(3, 0.1).Bind(4, bytes).Run();
  insert.Bind(1, std::int64_t{2}).BindNull(2).Bind(3, 2.0).Bind(4, std::span<std::byte>()).Run();

  auto select = db.Prepare("SELECT * FROM t ORDER BY id");
  ASSERT_TRUE(select.Step());
  EXPECT_EQ(select.Text(1), "a'b");
  EXPECT_EQ(select.Real(2), 0.1);
  EXPECT_THAT(select.Blob(3), testing::ElementsAreArray(bytes));
  ASSERT_TRUE(select.Step());
  EXPECT_TRUE(select.IsNull(1));
  EXPECT_FALSE(select.IsNull(3));
  EXPECT_EQ(select.Blob(3).size(), 0u);
  EXPECT_FALSE(select.Step());
}

TEST(Sqlite, ATransactionThatIsNotCommittedLeavesNothing) {
  const test::TempDir dir;
  auto db = SqliteDatabase::Open(dir / "a.db", Mode::kCreate);
  db.Execute("CREATE TABLE t(id INTEGER)");
  {
    SqliteTransaction transaction(db);
    db.Execute("INSERT INTO t VALUES(1)");
  }
  auto count = db.Prepare("SELECT COUNT(*) FROM t");
  ASSERT_TRUE(count.Step());
  EXPECT_EQ(count.Int(0), 0);
}

TEST(Sqlite, NamesThePathOfAFileThatIsMissingOrNoDatabase) {
  const test::TempDir dir;
  EXPECT_THAT([&] { SqliteDatabase::Open(dir / "missing.db", Mode::kRead); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("missing.db")));
  std::ofstream(dir / "text.db") << std::string(4096, 'x');
  EXPECT_THAT([&] { SqliteDatabase::Open(dir / "text.db", Mode::kRead); },
              testing::ThrowsMessage<Error>(testing::AllOf(testing::HasSubstr("text.db"),
                                                           testing::HasSubstr("not a database"))));
}

TEST(Sqlite, SaysWhyAFileCannotBeOpened) {
  const test::TempDir dir;
  EXPECT_THAT([&] { SqliteDatabase::Open(dir / "no/a.db", Mode::kCreate); },
              testing::ThrowsMessage<Error>(testing::HasSubstr(
                  "no/a.db: unable to open database file: No such file or directory")));
}

// A view may go on for ever: what is in a file is data, never a program.
TEST(Sqlite, RunsNoCodeThatAFileBrings) {
  const test::TempDir dir;
  {
    auto db = SqliteDatabase::Open(dir / "a.db", Mode::kCreate);
    db.Execute(
        "CREATE TABLE t(id INTEGER); CREATE TABLE u(id INTEGER);"
        "CREATE VIEW same AS SELECT id FROM t;"
        "CREATE VIEW endless AS WITH RECURSIVE c(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM c)"
        "  SELECT n AS id FROM c;"
        "CREATE TRIGGER copy AFTER INSERT ON t BEGIN INSERT INTO u VALUES(new.id); END");
  }
  auto db = SqliteDatabase::Open(dir / "a.db", Mode::kCreate);
  EXPECT_THAT([&] { db.Prepare("SELECT id FROM same"); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("access to view \"same\"")));
  EXPECT_THROW(db.Prepare("SELECT id FROM endless"), Error);
  db.Execute("INSERT INTO t VALUES(1)");
  auto count = db.Prepare("SELECT COUNT(*) FROM u");
  ASSERT_TRUE(count.Step());
  EXPECT_EQ(count.Int(0), 0);
}

std::string BigEndian(std::uint64_t value, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i) & 0xFF);
  return text;
}

// A database of one table t(id INTEGER PRIMARY KEY, name TEXT) with one row.
void WriteOneRow(const std::filesystem::path& path, const std::string& name = "x") {
  auto db = SqliteDatabase::Open(path, Mode::kCreate);
  db.Execute("CREATE TABLE t(id INTEGER PRIMARY KEY, name TEXT)");
  db.Prepare("INSERT INTO t VALUES(1, ?)").Bind(1, name).Run();
}

// A journal to be rolled back may name another file, which SQLite then deletes.
TEST(Sqlite, AJournalDeletesNoOtherFile) {
  const test::TempDir dir;
  WriteOneRow(dir / "a.db");
  WriteBytes(dir / "victim", "precious");
  const std::string magic = "\xd9\xd5\x05\xf9\x20\xa1\x63\xd7";
  const std::string victim = dir / "victim";
  std::uint64_t sum = 0;
  for (const char c : victim) sum += static_cast<std::uint64_t>(c);
  std::string journal =
      magic + BigEndian(0, 8) + BigEndian(2, 4) + BigEndian(512, 4) + BigEndian(4096, 4);
  journal.resize(512, '\0');
  journal += BigEndian(0x40000000 / 4096 + 1, 4) + victim + BigEndian(victim.size(), 4) +
             BigEndian(sum, 4) + magic;
  WriteBytes(dir / "a.db-journal", journal);
  EXPECT_THAT([&] { SqliteDatabase::Open(dir / "a.db", Mode::kRead); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("a program died")));
  EXPECT_EQ(ReadBytes(dir / "victim"), "precious");
}

// COLMAP's databases are of this kind. SQLite itself would leave two files beside them.
TEST(Sqlite, ReadsADatabaseWithALogAndWritesNothing) {
  const test::TempDir dir;
  const auto names = [&dir] {
    std::set<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator(dir.path())) {
      found.insert(entry.path().filename().string());
    }
    return found;
  };
  const auto count = [&dir] {
    auto db = SqliteDatabase::Open(dir / "a ?#%41.db", Mode::kRead);
    auto select = db.Prepare("SELECT COUNT(id) FROM t");
    return select.Step() ? select.Int(0) : -1;
  };
  {
    auto db = SqliteDatabase::Open(dir / "a ?#%41.db", Mode::kCreate);
    db.Execute("PRAGMA journal_mode = WAL; CREATE TABLE t(id INTEGER)");
    db.Execute("INSERT INTO t VALUES(1)");
    // As a program that died leaves it: the row is in the log alone.
    EXPECT_EQ(count(), 1);
    EXPECT_EQ(names().size(), 3u);
  }
  std::filesystem::remove(dir / "a ?#%41.db-shm");
  EXPECT_EQ(count(), 1);
  EXPECT_THAT(names(), testing::ElementsAre("a ?#%41.db", "a ?#%41.db-wal"));
  std::filesystem::remove(dir / "a ?#%41.db-wal");
  EXPECT_THROW(count(), Error) << "what was in the log is lost";
  EXPECT_THAT(names(), testing::ElementsAre("a ?#%41.db"));
}

// It lies beside the file, not beside the link: without it the rows are those of long ago.
TEST(Sqlite, ReadsTheLogOfADatabaseBehindALink) {
  const test::TempDir dir;
  std::filesystem::create_directory(dir / "there");
  auto writer = SqliteDatabase::Open(dir / "there/a.db", Mode::kCreate);
  writer.Execute("PRAGMA journal_mode = WAL; CREATE TABLE t(id INTEGER)");
  writer.Execute("PRAGMA wal_checkpoint(TRUNCATE); INSERT INTO t VALUES(1)");
  std::filesystem::create_symlink("there/a.db", dir / "link.db");
  auto db = SqliteDatabase::Open(dir / "link.db", Mode::kRead);
  auto select = db.Prepare("SELECT COUNT(id) FROM t");
  ASSERT_TRUE(select.Step());
  EXPECT_EQ(select.Int(0), 1);
}

TEST(Sqlite, WaitsForNoPipeBesideIt) {
  const test::TempDir dir;
  for (const char* suffix : {"-journal", "-wal"}) {
    const std::string name = std::string("a") + suffix;
    WriteOneRow(dir / name);
    ASSERT_EQ(mkfifo((dir / (name + suffix)).c_str(), 0600), 0);
    EXPECT_THAT([&] { SqliteDatabase::Open(dir / name, Mode::kRead); },
                testing::ThrowsMessage<Error>(testing::HasSubstr("a pipe, a socket")));
  }
}

// Another program's transactions make and remove them all the time.
TEST(Sqlite, WhatComesAndGoesBesideItIsNotMissed) {
  const test::TempDir dir;
  WriteOneRow(dir / "a.db");
  for (const char* suffix : {"-journal", "-wal"}) {
    std::atomic<bool> is_over = false;
    std::thread other([beside = (dir / "a.db").string() + suffix, &is_over] {
      while (!is_over) {
        std::ofstream(beside).flush();
        std::filesystem::remove(beside);
      }
    });
    EXPECT_NO_THROW({
      for (int i = 0; i < 2000; ++i) SqliteDatabase::Open(dir / "a.db", Mode::kRead);
    });
    is_over = true;
    other.join();
  }
}

// 30 KB with 10^16 rows: every page is a hundred times the child of the one before.
TEST(Sqlite, ReadsNoMoreRowsThanAFileCanHold) {
  const test::TempDir dir;
  WriteOneRow(dir / "a.db");
  std::string bytes = ReadBytes(dir / "a.db");
  constexpr std::size_t kPage = 4096;
  constexpr std::size_t kRoot = 1;  // the second page
  ASSERT_EQ(bytes.size(), 2 * kPage);
  const auto parent_of = [](std::size_t child) {
    std::string page(kPage, '\0');
    constexpr std::size_t kCells = 100;
    constexpr std::size_t kCellBytes = 5;
    page[0] = 5;
    page.replace(3, 4, BigEndian(kCells, 2) + BigEndian(kPage - kCells * kCellBytes, 2));
    page.replace(8, 4, BigEndian(child, 4));
    for (std::size_t i = 0; i < kCells; ++i) {
      const std::size_t at = kPage - (i + 1) * kCellBytes;
      page.replace(12 + 2 * i, 2, BigEndian(at, 2));
      page.replace(at, kCellBytes, BigEndian(child, 4) + '\x01');
    }
    return page;
  };
  bytes += bytes.substr(kRoot * kPage, kPage);
  std::size_t last = 3;  // counted from 1
  for (; last < 9; ++last) bytes += parent_of(last);
  bytes.replace(kRoot * kPage, kPage, parent_of(last));
  bytes.replace(28, 4, BigEndian(bytes.size() / kPage, 4));
  WriteBytes(dir / "a.db", bytes);

  auto db = SqliteDatabase::Open(dir / "a.db", Mode::kRead);
  const auto damaged = testing::ThrowsMessage<Error>(testing::HasSubstr("damaged"));
  auto rows = db.Prepare("SELECT name FROM t");
  EXPECT_THAT([&] { rows.Run(); }, damaged);
  auto count = db.Prepare("SELECT COUNT(name) FROM t");
  EXPECT_THAT([&] { count.Run(); }, damaged);
  auto sorted = db.Prepare("SELECT name FROM t ORDER BY name");
  EXPECT_THAT([&] { sorted.Run(); }, damaged);
}

TEST(Sqlite, ReadsNoTableThatIsAProgram) {
  const test::TempDir dir;
  for (const char* table : {"CREATE TABLE b(x INTEGER, y BLOB AS (zeroblob(100000000)))",
                            "CREATE TABLE b(x INTEGER, y AS (x + 1) STORED)",
                            "CREATE VIRTUAL TABLE b USING fts5(x)"}) {
    std::filesystem::remove(dir / "a.db");
    SqliteDatabase::Open(dir / "a.db", Mode::kCreate).Execute(table);
    EXPECT_THAT([&] { SqliteDatabase::Open(dir / "a.db", Mode::kRead); },
                testing::ThrowsMessage<Error>(testing::HasSubstr("virtual or has computed")))
        << table;
  }
}

TEST(Sqlite, AnErrorIsOneLineWhateverTheSchemaHolds) {
  const test::TempDir dir;
  {
    auto db = SqliteDatabase::Open(dir / "a.db", Mode::kCreate);
    db.Execute("CREATE TABLE t(id INTEGER); CREATE TABLE \"a\nb\"(id INTEGER)");
    db.Execute("PRAGMA writable_schema = ON");
    db.Execute(
        "UPDATE sqlite_master SET sql = 'CREATE TABLE no' || char(10) || 'sense' "
        "WHERE name LIKE 'a%'");
  }
  try {
    SqliteDatabase::Open(dir / "a.db", Mode::kRead).Execute("SELECT * FROM t");
    FAIL() << "it was read";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("malformed"));
    EXPECT_THAT(error.what(), testing::Not(testing::HasSubstr("\n")));
  }
}

}  // namespace
}  // namespace cohort
