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

// The limits of a statement from its first Step to its last, in instructions of SQLite's virtual
// machine, in rows, and in bytes of their texts and blobs, in proportion to the file. In a damaged
// file, pages may be each other's children many times, so that 50 KB have 10^16 rows.
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
// Throws Error naming the database's path and SQLite's message. Must not outlive its database.
class SqliteStatement {
 public:
  SqliteStatement& Bind(int parameter, std::int64_t value);
  SqliteStatement& Bind(int parameter, double value);
  SqliteStatement& Bind(int parameter, std::string_view text);
  SqliteStatement& Bind(int parameter, std::span<const std::byte> blob);
  SqliteStatement& BindNull(int parameter);

  bool Step();  // true: there is a row; false: done, and reset for the next use
  void Run();   // steps to the end and resets

  // Columns of the current row. Text and Blob stay valid until the next Step.
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
  SqliteWork* step_;        // what the current Step may still do, of the database
  const SqliteWork* most_;  // of a statement
  SqliteWork done_;         // since the first Step
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

// An open SQLite file, closed at the end of the scope. The file may be untrusted: no code in it
// runs, its pages cannot cause more work or rows than a file of its size can hold, and a journal
// beside it affects no other file.
class SqliteDatabase {
 public:
  // kRead: writes nothing, neither in the file nor beside it, and reads a write-ahead log in place.
  // kCreate: a file of ours, created if missing. Throws Error naming the path, also if a crashed
  // program left a transaction half written.
  enum class Mode { kRead, kCreate };
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
    SqliteWork step;  // what the current call may still do
  };
  std::unique_ptr<Work> work_;  // before db_, which points to it
  std::unique_ptr<sqlite3, Close> db_;
};

// Call this before placing a file at PATH: SQLite would play a journal or log that a crashed
// program left beside PATH into the next file of that name. Throws Error naming what cannot be
// removed.
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
