#include "frontend/core/sqlite.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <fstream>

#include "frontend/core/error.h"
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
  auto db = SqliteDatabase::Open(dir / "a.db", Mode::kWrite);
  EXPECT_THAT([&] { db.Prepare("SELECT id FROM same"); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("access to view \"same\"")));
  EXPECT_THROW(db.Prepare("SELECT id FROM endless"), Error);
  db.Execute("INSERT INTO t VALUES(1)");
  auto count = db.Prepare("SELECT COUNT(*) FROM u");
  ASSERT_TRUE(count.Step());
  EXPECT_EQ(count.Int(0), 0);
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
