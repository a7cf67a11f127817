#pragma once

#include <filesystem>

namespace cohort {

// Call this before SQLite rolls a database back by its journal (www.sqlite.org/fileformat2.html,
// 3). Throws Error if the journal would delete another file or belongs to another database. SQLite
// checks neither: it plays the journal of a killed run into any file of that name, even a complete
// one.
void CheckJournal(const std::filesystem::path& database, const std::filesystem::path& journal);

}  // namespace cohort
