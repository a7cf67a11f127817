#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

struct sqlite3;
struct sqlite3_stmt;

namespace cohort {

// What a statement may do from its first Step to its last, in instructions of SQLite's machine, in
// rows, and in bytes of their texts and blobs: in proportion to the file. Pages of a damaged one may be
// each other's children many times, and 50 KB then have 10^16 rows.
struct SqliteWork {
  std::uint64_t instructions = 0;
  std::uint64_t rows = 0;
  std::uint64_t bytes = 0;
};

// A prepared statement. Parameters count from 1, columns from 0, as in SQLite.
//
//   auto insert = db.Prepare("INSERT INTO t VALUES(?, ?)");
//   insert.Bind(1, id).Bind(2, name).Run();
//   auto select = db.Prepare("SELECT id, name FROM t ORDER BY id");
//   while (select.Step()) Use(select.Int(0), select.Text(1));
//
// Throws Error naming the database's path and what SQLite says. Must not outlive its database.
class SqliteStatement {
 public:
  SqliteStatement& Bind(int parameter, std::int64_t value);
  SqliteStatement& Bind(int parameter, double value);
  SqliteStatement& Bind(int parameter, std::string_view text);
  SqliteStatement& Bind(int parameter, std::span<const std::byte> blob);
  SqliteStatement& BindNull(int parameter);

  bool Step();  // true: there is a row; false: done, and reset for the next use
  void Run();   // steps to the end and resets

  // Of the current row. Text and Blob stay valid until the next Step.
  bool IsNull(int column) const;
  std::int64_t Int(int column) const;
  double Real(int column) const;
  std::string_view Text(int column) const;
  std::span<const std::byte> Blob(int column) const;

 private:
  friend class SqliteDatabase;
  SqliteStatement(sqlite3* db, SqliteWork* step, const SqliteWork* most, sqlite3_stmt* statement);
  void CheckBound(int result) const;
  void CountRow();

  struct Finalize {
    void operator()(sqlite3_stmt* statement) const;
  };
  sqlite3* db_;
  SqliteWork* step_;        // what the Step that runs may still do, of the database
  const SqliteWork* most_;  // of a statement
  SqliteWork done_;         // since the first Step
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

// An open SQLite file, closed at the end of the scope. It may be anybody's: no code that it brings is
// run; what its pages claim costs no more work, and no more rows, than a file of its size can hold;
// and a journal beside it touches no other file.
class SqliteDatabase {
 public:
  // kRead: nothing is written, nor beside it; a write-ahead log is read where it lies. kWrite: must
  // exist; what a program that died has left half written in it is undone. kCreate: kWrite, and made
  // if missing. Throws Error naming the path.
  enum class Mode { kRead, kWrite, kCreate };
  static SqliteDatabase Open(const std::filesystem::path& path, Mode mode);

  void Execute(const std::string& sql);  // one or more statements without results
  SqliteStatement Prepare(std::string_view sql);
  bool HasTable(std::string_view name);
  std::int64_t UserVersion();

 private:
  struct Close {
    void operator()(sqlite3* db) const;
  };
  explicit SqliteDatabase(sqlite3* db);
  void LimitWork(std::uint64_t file_bytes);
  void CheckTables();
  struct Work {
    SqliteWork most;  // of a statement
    SqliteWork step;  // what the call that runs may still do
  };
  std::unique_ptr<Work> work_;  // before db_, which points to it
  std::unique_ptr<sqlite3, Close> db_;
};

// A journal or a log that a program which died has left beside PATH SQLite would play into the next
// file of that name: to be called before one is put there. What a journal tells is undone first, so that
// PATH itself is whole until it is replaced. Throws Error naming what cannot be removed.
void RemoveJournals(const std::filesystem::path& path);

// BEGIN ... COMMIT; rolls back at the end of the scope unless committed.
class SqliteTransaction {
 public:
  explicit SqliteTransaction(SqliteDatabase& db);
  SqliteTransaction(const SqliteTransaction&) = delete;
  SqliteTransaction& operator=(const SqliteTransaction&) = delete;
  ~SqliteTransaction();
  void Commit();

 private:
  SqliteDatabase& db_;
  bool open_ = true;
};

}  // namespace cohort
