#pragma once

#include <filesystem>

namespace cohort {

// Before SQLite undoes in a database what its rollback journal tells (www.sqlite.org/fileformat2.html,
// 3): throws Error if the journal would delete another file, or is not of this database. SQLite asks
// neither: that of a killed run is played into any file that comes to its name, a whole and finished one.
void CheckJournal(const std::filesystem::path& database, const std::filesystem::path& journal);

}  // namespace cohort
