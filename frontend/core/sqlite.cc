#include "frontend/core/sqlite.h"

#include <sqlite3.h>

#include "frontend/core/error.h"

namespace cohort {
namespace {

// What to do about it, where the message alone does not say.
const char* Advice(int code) {
  switch (code & 0xFF) {
    case SQLITE_FULL:
    case SQLITE_IOERR:
      return " (free some disk space, or choose another folder)";
    case SQLITE_READONLY:
      return " (check that the file and its folder may be written)";
    case SQLITE_BUSY:
      return " (another program is writing it: wait for its end)";
    default:
      return "";
  }
}

[[noreturn]] void ThrowSqlite(sqlite3* db) {
  const char* path = sqlite3_db_filename(db, "main");
  ThrowError("database {}: {}{}",
             path != nullptr ? path : "(unnamed)",
             sqlite3_errmsg(db),
             Advice(sqlite3_extended_errcode(db)));
}

}  // namespace

void SqliteStatement::Finalize::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

void SqliteDatabase::Close::operator()(sqlite3* db) const { sqlite3_close_v2(db); }

SqliteStatement::SqliteStatement(sqlite3* db, sqlite3_stmt* statement)
    : db_(db), statement_(statement) {}

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
  const int result = sqlite3_step(statement_.get());
  if (result == SQLITE_ROW) return true;
  if (result == SQLITE_DONE) {
    sqlite3_reset(statement_.get());
    return false;
  }
  // Resetting repeats the step's error in the database, so the message survives it.
  sqlite3_reset(statement_.get());
  ThrowSqlite(db_);
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

SqliteDatabase SqliteDatabase::Open(const std::filesystem::path& path, Mode mode) {
  int flags = SQLITE_OPEN_READONLY;
  if (mode == Mode::kWrite) flags = SQLITE_OPEN_READWRITE;
  if (mode == Mode::kCreate) flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
  sqlite3* raw = nullptr;
  const int result = sqlite3_open_v2(path.c_str(), &raw, flags, nullptr);
  SqliteDatabase db(raw);
  if (result != SQLITE_OK) {
    ThrowError("database {}: {}",
               path.string(),
               raw != nullptr ? sqlite3_errmsg(raw) : sqlite3_errstr(result));
  }
  // Files of others hold what they like: no code of theirs (views, triggers, functions in the schema)
  // is run, and what says of its own size that it is larger than its page is an error.
  for (const int code_in_schema : {SQLITE_DBCONFIG_ENABLE_VIEW,
                                   SQLITE_DBCONFIG_ENABLE_TRIGGER,
                                   SQLITE_DBCONFIG_TRUSTED_SCHEMA}) {
    sqlite3_db_config(raw, code_in_schema, 0, nullptr);
  }
  db.Execute("PRAGMA cell_size_check = ON");
  // Opening reads nothing: this says at once that the file is no database, or damaged.
  db.Execute("PRAGMA schema_version");
  return db;
}

void SqliteDatabase::Execute(const std::string& sql) {
  if (sqlite3_exec(db_.get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
    ThrowSqlite(db_.get());
  }
}

SqliteStatement SqliteDatabase::Prepare(std::string_view sql) {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(
          db_.get(), sql.data(), static_cast<int>(sql.size()), &statement, nullptr) != SQLITE_OK) {
    ThrowSqlite(db_.get());
  }
  return SqliteStatement(db_.get(), statement);
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
