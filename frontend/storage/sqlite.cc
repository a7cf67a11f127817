#include "frontend/storage/sqlite.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <limits>

#include "frontend/core/error.h"
#include "frontend/storage/input_file.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kUnlimited = std::numeric_limits<std::uint64_t>::max();
constexpr int kPatienceMs = 10'000;       // while another program writes
constexpr int kInstructionsACall = 1000;  // of the progress handler
// A row has at least four bytes in a page; a byte of a real table costs one or two instructions.
constexpr std::uint64_t kBytesARow = 4;
constexpr std::uint64_t kInstructionsAByte = 32;
constexpr std::uint64_t kReadings = 4;  // of a text or blob by one statement

// Advice for errors whose message does not say what to do.
const char* Advice(int code) {
  if (code == SQLITE_READONLY_ROLLBACK) {
    return " (a program died while writing it: open it once with that program)";
  }
  if (code == SQLITE_INTERRUPT) return " (it is damaged: it has more rows than it has room for)";
  switch (code & 0xFF) {
    case SQLITE_FULL:
    case SQLITE_IOERR:
      return " (free some disk space, or choose another folder)";
    case SQLITE_READONLY:
      return " (check that the file and its folder may be written)";
    case SQLITE_BUSY:
      return " (another program has locked it: wait until that program ends)";
    default:
      return "";
  }
}

int CountInstructions(void* step) {
  std::uint64_t& left = static_cast<SqliteWork*>(step)->instructions;
  if (left < kInstructionsACall) return 1;  // interrupts the statement
  left -= kInstructionsACall;
  return 0;
}

fs::path Beside(const fs::path& path, const char* suffix) { return path.string() + suffix; }

// SQLite follows links, so a log or a journal lies beside the link's target.
fs::path WithoutLinks(const fs::path& path) {
  std::error_code error;
  fs::path file = fs::canonical(path, error);
  return error ? path : file;
}

// The size of a file; 0 if it does not exist.
std::uint64_t BytesOf(const fs::path& path) {
  std::error_code error;
  const std::uintmax_t bytes = fs::file_size(path, error);
  return error ? 0 : bytes;
}

// Whether the database states that it has a write-ahead log.
bool SaysItHasALog(const fs::path& path) {
  const Descriptor file = OpenInputDescriptor(path);
  std::array<unsigned char, 20> head{};
  constexpr std::size_t kReadVersion = 19;
  return pread(file.get(), head.data(), head.size(), 0) == static_cast<ssize_t>(head.size()) &&
         head[kReadVersion] == 2;
}

std::string UriOf(const fs::path& path) {
  std::string uri = "file:";
  for (const char c : fs::absolute(path).string()) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '/' || c == '.' || c == '_' || c == '-';
    uri += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return uri;
}

// The file may disappear, because the last program that closes a database removes its log.
void CheckIfThere(const fs::path& log) {
  try {
    CheckInputFile(log);
  } catch (const MissingFileError&) {
  }
}

// SQLite's message and, if a file could not be opened, the system's reason.
std::string WhatSqliteSays(sqlite3* db) {
  const std::string what = sqlite3_errmsg(db);
  const int reason = sqlite3_system_errno(db);  // persists after later errors of other kinds
  const bool tells = (sqlite3_errcode(db) & 0xFF) == SQLITE_CANTOPEN && reason != 0;
  return tells ? what + ": " + std::strerror(reason) : what;
}

[[noreturn]] void ThrowSqlite(sqlite3* db) {
  const char* path = sqlite3_db_filename(db, "main");
  ThrowError("database {}: {}{}",
             path != nullptr ? path : "(unnamed)",
             WhatSqliteSays(db),
             Advice(sqlite3_extended_errcode(db)));
}

}  // namespace

void SqliteStatement::Finalize::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

void SqliteDatabase::Close::operator()(sqlite3* db) const { sqlite3_close_v2(db); }

SqliteStatement::SqliteStatement(sqlite3* db,
                                 SqliteWork* step,
                                 const SqliteWork* most,
                                 sqlite3_stmt* statement)
    : db_(db), step_(step), most_(most), statement_(statement) {}

void SqliteStatement::CheckBound(int result) const {
  if (result != SQLITE_OK) ThrowSqlite(db_);
}

SqliteStatement& SqliteStatement::Bind(int parameter, std::int64_t value) {
  CheckBound(sqlite3_bind_int64(statement_.get(), parameter, value));
  return *this;
}

SqliteStatement& SqliteStatement::Bind(int parameter, double value) {
  CheckBound(sqlite3_bind_double(statement_.get(), parameter, value));
  return *this;
}

SqliteStatement& SqliteStatement::Bind(int parameter, std::string_view text) {
  CheckBound(sqlite3_bind_text64(
      statement_.get(), parameter, text.data(), text.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
  return *this;
}

SqliteStatement& SqliteStatement::Bind(int parameter, std::span<const std::byte> blob) {
  // A null pointer would bind NULL; an empty blob is not NULL.
  CheckBound(blob.empty()
                 ? sqlite3_bind_zeroblob(statement_.get(), parameter, 0)
                 : sqlite3_bind_blob64(
                       statement_.get(), parameter, blob.data(), blob.size(), SQLITE_TRANSIENT));
  return *this;
}

SqliteStatement& SqliteStatement::BindNull(int parameter) {
  CheckBound(sqlite3_bind_null(statement_.get(), parameter));
  return *this;
}

bool SqliteStatement::Step() {
  const std::uint64_t left = most_->instructions - done_.instructions;
  step_->instructions = left;
  const int result = sqlite3_step(statement_.get());
  done_.instructions += left - step_->instructions;
  if (result == SQLITE_ROW) {
    CountRow();
    return true;
  }
  done_ = {};
  if (result == SQLITE_DONE) {
    sqlite3_reset(statement_.get());
    return false;
  }
  // Resetting reports the step's error again, so the message survives.
  sqlite3_reset(statement_.get());
  ThrowSqlite(db_);
}

void SqliteStatement::CountRow() {
  ++done_.rows;
  for (int column = 0; column < sqlite3_column_count(statement_.get()); ++column) {
    const int type = sqlite3_column_type(statement_.get(), column);
    if (type != SQLITE_TEXT && type != SQLITE_BLOB) continue;
    done_.bytes += static_cast<std::uint64_t>(sqlite3_column_bytes(statement_.get(), column));
  }
  if (done_.rows <= most_->rows && done_.bytes <= most_->bytes) return;
  done_ = {};
  sqlite3_reset(statement_.get());
  ThrowError("database {} is damaged: it has more rows than it has room for",
             sqlite3_db_filename(db_, "main"));
}

void SqliteStatement::Run() {
  while (Step()) {
  }
}

bool SqliteStatement::IsNull(int column) const {
  return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL;
}

std::int64_t SqliteStatement::Int(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

double SqliteStatement::Real(int column) const {
  return sqlite3_column_double(statement_.get(), column);
}

std::string_view SqliteStatement::Text(int column) const {
  const auto* text = sqlite3_column_text(statement_.get(), column);
  const auto size = sqlite3_column_bytes(statement_.get(), column);
  return {reinterpret_cast<const char*>(text), static_cast<std::size_t>(size)};
}

std::span<const std::byte> SqliteStatement::Blob(int column) const {
  const void* data = sqlite3_column_blob(statement_.get(), column);
  const auto size = sqlite3_column_bytes(statement_.get(), column);
  return {static_cast<const std::byte*>(data), static_cast<std::size_t>(size)};
}

SqliteDatabase::SqliteDatabase(sqlite3* db) : work_(std::make_unique<Work>()), db_(db) {
  work_->most = {kUnlimited, kUnlimited, kUnlimited};
}

SqliteDatabase SqliteDatabase::Open(const fs::path& path, Mode mode) {
  const fs::path file = WithoutLinks(path);
  const fs::path log = Beside(file, "-wal");
  std::string uri = UriOf(file);
  const bool has_log = BytesOf(log) > 0;
  int flags = SQLITE_OPEN_URI | SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
  const char* vfs = nullptr;
  if (mode == Mode::kRead) {
    CheckInputFile(path);
    for (const char* suffix : {"-wal", "-journal"}) CheckIfThere(Beside(file, suffix));
    flags = SQLITE_OPEN_URI | SQLITE_OPEN_READONLY;
    // SQLite shares its index of a log through a file beside it, unless it holds the database
    // exclusively, whose locks require write permission. Without locks the index is in memory.
    if (has_log) vfs = "unix-none";
    if (!has_log && SaysItHasALog(path)) uri += "?immutable=1";
  }
  // Before opening, since the file may be renamed later.
  const std::uint64_t bytes = BytesOf(file) + BytesOf(log);
  sqlite3* raw = nullptr;
  const int result = sqlite3_open_v2(uri.c_str(), &raw, flags, vfs);
  SqliteDatabase db(raw);
  if (result != SQLITE_OK) {
    constexpr std::size_t kLongestPath = 500;  // of SQLite's 512 bytes, which include "-journal"
    const bool too_long = fs::absolute(file).native().size() > kLongestPath;
    const std::string what =
        fmt::format("database {}: {}{}",
                    path.string(),
                    raw != nullptr ? WhatSqliteSays(raw) : sqlite3_errstr(result),
                    too_long ? "; its path is longer than SQLite takes, 500 bytes" : "");
    const bool gone = raw != nullptr && sqlite3_system_errno(raw) == ENOENT;  // by now
    if (gone && mode == Mode::kRead) throw MissingFileError(what);
    throw Error(what);
  }
  sqlite3_busy_timeout(raw, kPatienceMs);
  // A file may be malicious: no code in it (views, triggers, functions in the schema) runs, and a
  // cell that claims to be larger than its page is an error.
  for (const int code_in_schema : {SQLITE_DBCONFIG_ENABLE_VIEW,
                                   SQLITE_DBCONFIG_ENABLE_TRIGGER,
                                   SQLITE_DBCONFIG_TRUSTED_SCHEMA}) {
    sqlite3_db_config(raw, code_in_schema, 0, nullptr);
  }
  sqlite3_db_config(raw, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  if (has_log) db.Execute("PRAGMA locking_mode = EXCLUSIVE");
  db.Execute("PRAGMA cell_size_check = ON");
  if (mode == Mode::kRead) db.LimitWork(bytes);
  // Opening reads nothing, so this detects at once a file that is damaged or not a database.
  db.Execute("PRAGMA schema_version");
  if (mode == Mode::kRead) db.CheckTables();
  return db;
}

void SqliteDatabase::LimitWork(std::uint64_t file_bytes) {
  constexpr std::uint64_t kLeast = 1 << 19;  // for a small file
  const std::uint64_t bytes = std::max(file_bytes, kLeast);
  work_->most = {kInstructionsAByte * bytes, bytes / kBytesARow, kReadings * bytes};
  work_->step = work_->most;
  sqlite3_progress_handler(db_.get(), kInstructionsACall, CountInstructions, &work_->step);
  constexpr std::uint64_t kLongest = 1'000'000'000;  // SQLite's own
  sqlite3_limit(db_.get(), SQLITE_LIMIT_LENGTH, static_cast<int>(std::min(bytes, kLongest)));
}

// Computed columns may have any size, and virtual tables are code.
void SqliteDatabase::CheckTables() {
  auto table = Prepare(
      "SELECT name FROM sqlite_master WHERE type = 'table' AND (rootpage = 0 OR EXISTS "
      "(SELECT 1 FROM pragma_table_xinfo(sqlite_master.name) WHERE hidden > 0)) LIMIT 1");
  if (table.Step()) {
    ThrowError(
        "database {}: its table {} is virtual or has computed columns, which are not supported",
        sqlite3_db_filename(db_.get(), "main"),
        table.Text(0));
  }
}

void SqliteDatabase::Execute(const std::string& sql) {
  work_->step = work_->most;
  if (sqlite3_exec(db_.get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
    ThrowSqlite(db_.get());
  }
}

SqliteStatement SqliteDatabase::Prepare(std::string_view sql) {
  sqlite3_stmt* statement = nullptr;
  work_->step = work_->most;
  if (sqlite3_prepare_v2(
          db_.get(), sql.data(), static_cast<int>(sql.size()), &statement, nullptr) != SQLITE_OK) {
    ThrowSqlite(db_.get());
  }
  return SqliteStatement(db_.get(), &work_->step, &work_->most, statement);
}

bool SqliteDatabase::HasTable(std::string_view name) {
  auto select = Prepare("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?");
  return select.Bind(1, name).Step();
}

std::int64_t SqliteDatabase::UserVersion() {
  auto select = Prepare("PRAGMA user_version");
  select.Step();
  return select.Int(0);
}

void RemoveJournals(const fs::path& path) {
  for (const char* suffix : {"-wal", "-shm", "-journal"}) {
    const fs::path journal = Beside(path, suffix);
    std::error_code error;
    fs::remove(journal, error);
    if (error) ThrowError("cannot remove {}: {}", journal.string(), error.message());
  }
}

SqliteTransaction::SqliteTransaction(SqliteDatabase& db) : db_(db) { db_.Execute("BEGIN"); }

SqliteTransaction::~SqliteTransaction() {
  if (!open_) return;
  try {
    db_.Execute("ROLLBACK");
  } catch (const Error&) {
    // The error that ended the scope is the one to report (SQLite may have rolled back already).
  }
}

void SqliteTransaction::Commit() {
  db_.Execute("COMMIT");
  open_ = false;
}

}  // namespace cohort
