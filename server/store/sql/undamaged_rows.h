#pragma once

#include <string>

#include "base/error.h"
#include "server/store/damaged_records.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// A table, for reading it although it is damaged.
struct DamagedTable {
  const char* what;      // plural, for the log
  const char* some;      // selects a column of any row that no index has; ends before ORDER BY
  const char* key;       // for ORDER BY: the primary key, and
  const char* reversed;  // the same backwards
};

// True if the table's first or last row can be read, or it is empty.
inline bool can_read_some(SqlDatabase& database, const DamagedTable& table) {
  for (const char* order : {table.key, table.reversed}) {
    try {
      database.query(std::string(table.some) + " ORDER BY " + order + " LIMIT 1");
      return true;
    } catch (const Error& error) {
      if (!is_of_damaged_database(error)) throw;
    }
  }
  return false;
}

// Calls `take(rows)` for each row that can be read although pages of the table are damaged: from
// both ends up to the damage. Some rows are passed twice. `query` ends before ORDER BY. Reads the
// whole table. Throws the database's error if nothing of the table can be read.
template <class Take, class... Values>
void read_undamaged(SqlDatabase& database, const DamagedTable& table, const std::string& query,
                    const Take& take, const Values&... values) {
  bool has_read = false;
  for (const char* order : {table.key, table.reversed}) {
    try {
      return database.read([&](SqlConnection& connection) {
        Rows rows = connection.query(query + " ORDER BY " + order, values...);
        for (; rows.next(); has_read = true) take(rows);
      });
    } catch (const Error& error) {
      if (!is_of_damaged_database(error)) throw;
      const bool is_last = order == table.reversed;
      // Rows of others may be readable.
      if (is_last && !has_read && !can_read_some(database, table)) throw;
    }
  }
  report_damaged_table(table.what);
}

// Returns `list()`, or `rest()`, the part that can be read, if the database's file is damaged.
template <class List, class Rest>
auto list_despite_damage(const List& list, const Rest& rest) {
  try {
    return list();
  } catch (const Error& error) {
    if (!is_of_damaged_database(error)) throw;
  }
  return rest();
}

}  // namespace isomesh::store
