#pragma once

#include <string>

#include "base/error.h"
#include "server/store/damaged_records.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// Calls `take(rows)` for each row that can be read although pages of the table are damaged: from
// both ends up to the damage. Some rows are passed twice. `query` ends before ORDER BY; `key` and
// `reversed` order by the primary key. Reads the whole table.
template <class Take, class... Values>
void read_undamaged(SqlDatabase& database, const std::string& query, const char* key,
                    const char* reversed, const Take& take, const Values&... values) {
  for (const char* order : {key, reversed}) {
    try {
      return database.read([&](SqlConnection& connection) {
        Rows rows = connection.query(query + " ORDER BY " + order, values...);
        while (rows.next()) take(rows);
      });
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kInternal) throw;
    }
  }
}

// Returns `list()`. If the database cannot read it, because pages are damaged, returns `rest()`,
// the part that it can read; throws the error if there is none. `what`: plural, for the log.
template <class List, class Rest>
auto list_despite_damage(const char* what, const List& list, const Rest& rest) {
  try {
    return list();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kInternal) throw;
    auto readable = rest();
    if (readable.empty()) throw;
    report_damaged_table(what);
    return readable;
  }
}

}  // namespace isomesh::store
