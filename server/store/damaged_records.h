#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "base/error.h"
#include "proto/types.h"

namespace isomesh::store {

// The field of an error that tells that the file of the database is damaged.
inline constexpr const char* kDatabaseField = "database";

// Logs that a record is damaged, once for each record in the life of the process: lists and the
// queue meet it again and again. `kind` is the kind of record, such as "volume". Thread safe.
void report_damaged(std::string_view kind, const std::string& id);

// True for the error of a database whose file is damaged.
bool is_of_damaged_database(const Error& error);

// Logs once that some records of a table cannot be read at all. `what` is their plural.
void report_damaged_table(std::string_view what);

// The volume in a record. Empty if the record is damaged, or is that of another volume, which is
// reported: it must not hide others.
std::optional<Volume> readable_volume(const std::string& record, const std::string& id);

// Throws Error kInternal, whose `field` tells a client what is damaged.
[[noreturn]] void throw_damaged_volume(const std::string& field);

// True for that error.
bool is_of_damaged_volume(const Error& error);

}  // namespace isomesh::store
