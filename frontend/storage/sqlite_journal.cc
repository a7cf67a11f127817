#include "frontend/storage/sqlite_journal.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/storage/input_file.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using PageBytes = std::vector<unsigned char>;

constexpr std::array<unsigned char, 8> kJournalMagic{
    0xd9, 0xd5, 0x05, 0xf9, 0x20, 0xa1, 0x63, 0xd7};
constexpr std::size_t kCounterAt = 24;  // in a database, and so in its first page

class PagedFile {
 public:
  explicit PagedFile(const fs::path& path) : descriptor_(OpenInputDescriptor(path)) {
    fstat(descriptor_.get(), &status_);
  }

  std::uint64_t bytes() const { return static_cast<std::uint64_t>(status_.st_size); }
  // Differs for each journal, and while one is written.
  auto Mark() const {
    return std::tuple(
        status_.st_ino, status_.st_size, status_.st_mtim.tv_sec, status_.st_mtim.tv_nsec);
  }
  // False where there are not so many bytes.
  bool Read(std::uint64_t at, std::size_t count, PageBytes& read) const {
    read.resize(count);
    return at <= bytes() && pread(descriptor_.get(), read.data(), count, static_cast<off_t>(at)) ==
                                static_cast<ssize_t>(count);
  }

 private:
  Descriptor descriptor_;
  struct stat status_ {};
};

// None: it is gone, as that of a program that writes comes and goes.
std::unique_ptr<PagedFile> OpenIfThere(const fs::path& journal) {
  try {
    return std::make_unique<PagedFile>(journal);
  } catch (const MissingFileError&) {
    return nullptr;
  }
}

std::uint32_t BigEndian(const PageBytes& bytes, std::size_t at) {
  return std::uint32_t{bytes[at]} << 24U | std::uint32_t{bytes[at + 1]} << 16U |
         std::uint32_t{bytes[at + 2]} << 8U | bytes[at + 3];
}

struct JournalHeader {
  std::uint32_t records;  // 0xffffffff: to the end
  std::uint32_t pages;    // of the database before
  std::uint32_t sector_bytes;
  std::uint32_t page_bytes;
};

std::optional<JournalHeader> ReadJournalHeader(const PagedFile& journal, std::uint64_t at) {
  PageBytes head;
  if (!journal.Read(at, 28, head) ||
      !std::equal(kJournalMagic.begin(), kJournalMagic.end(), head.begin())) {
    return std::nullopt;
  }
  const JournalHeader header{.records = BigEndian(head, 8),
                             .pages = BigEndian(head, 16),
                             .sector_bytes = BigEndian(head, 20),
                             .page_bytes = BigEndian(head, 24)};
  const bool can_be = header.sector_bytes >= 32 && header.sector_bytes <= 65536 &&
                      header.page_bytes >= 512 && header.page_bytes <= 65536;
  return can_be ? std::optional(header) : std::nullopt;
}

// A transaction counts up the number in the first page, which it keeps in the journal before. As long as it
// does not (it does when it ends, and when it takes a new page, and cohort's with more pages than SQLite
// holds back do take some) nothing is changed yet: what the journal keeps is still so in the database.
bool IsJournalOf(const PagedFile& database, const PagedFile& journal) {
  const auto first = ReadJournalHeader(journal, 0);
  if (!first) return true;  // SQLite does not undo what has no header
  const std::uint64_t old_bytes = std::uint64_t{first->pages} * first->page_bytes;
  PageBytes page;
  PageBytes kept;
  if (first->pages == 0) {  // it was being made: nothing is kept, and it has counted to 1 at most
    constexpr std::size_t kHeaderBytes = 100;
    return !database.Read(0, kHeaderBytes, page) || BigEndian(page, kCounterAt) <= 1;
  }
  bool all_the_same = database.bytes() == old_bytes;
  std::uint64_t at = 0;
  while (const auto header = ReadJournalHeader(journal, at)) {
    at += header->sector_bytes;
    const std::uint64_t record_bytes = std::uint64_t{header->page_bytes} + 8;
    const std::uint64_t fit = (journal.bytes() - std::min(at, journal.bytes())) / record_bytes;
    const std::uint64_t records =
        header->records == 0 ? fit : std::min<std::uint64_t>(header->records, fit);
    for (std::uint64_t i = 0; i < records; ++i, at += record_bytes) {
      if (!journal.Read(at, header->page_bytes + 4, kept)) break;
      const std::uint32_t number = BigEndian(kept, 0);
      kept.erase(kept.begin(), kept.begin() + 4);
      if (number == 0) break;
      const std::uint64_t place = (std::uint64_t{number} - 1) * header->page_bytes;
      const bool is_there = database.Read(place, header->page_bytes, page);
      if (number == 1) {
        if (!is_there || database.bytes() < old_bytes) return false;
        const std::uint32_t counted = BigEndian(page, kCounterAt) - BigEndian(kept, kCounterAt);
        return counted <= 1;
      }
      all_the_same = all_the_same && is_there && page == kept;
    }
    at = (at + header->sector_bytes - 1) / header->sector_bytes * header->sector_bytes;
  }
  return all_the_same;
}

// A journal's last bytes may name a "super-journal", which SQLite deletes when it has undone what
// was half written: any file of the user's. Those of one database, as cohort's are, name none.
bool NamesAnotherFile(const PagedFile& journal) {
  PageBytes last;
  return journal.bytes() >= 16 && journal.Read(journal.bytes() - 8, 8, last) &&
         std::equal(kJournalMagic.begin(), kJournalMagic.end(), last.begin());
}

}  // namespace

void CheckJournal(const fs::path& database, const fs::path& journal) {
  using Mark = decltype(std::declval<PagedFile>().Mark());
  constexpr int kLooks = 100;
  constexpr auto kPause = std::chrono::milliseconds(30);
  std::optional<Mark> doubted;
  // Another program may be writing both between two of our looks: only what stays as it is is judged.
  for (int look = 0; look < kLooks; ++look) {
    const std::unique_ptr<PagedFile> file = OpenIfThere(journal);
    if (!file || file->bytes() < 16) return;
    if (NamesAnotherFile(*file)) {
      ThrowError("database {}: its journal {} names another file, that it would delete: remove it",
                 database.string(),
                 journal.string());
    }
    if (IsJournalOf(PagedFile(database), *file)) return;
    if (doubted == file->Mark()) {
      ThrowError(
          "database {}: {} seems to be the journal of another file that was here: open the "
          "database once by the program that wrote it, and remove the journal where that says the "
          "same",
          database.string(),
          journal.string());
    }
    doubted = file->Mark();
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace cohort
