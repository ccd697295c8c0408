// The hospital wing of the service: orders, PACS, received series, and sending the audit trail to a
// collector. The daemon is built without it if ISOMESH_HOSPITAL is off.
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "server/http/app/wing.h"

namespace isomesh::hospital {

std::vector<store::Schema> tables();

// Returns the files named by the file of --hospital. Throws Error kInvalidParameter if that is
// invalid. Has no side effects.
http::ConfiguredFiles check(const std::filesystem::path& file);

// Without a file, the wing is not open. Throws as check() does, and Error kUnavailable if it cannot
// listen for series.
std::unique_ptr<http::Wing> open(const http::WingSettings& settings,
                                 const http::WingServices& services);

}  // namespace isomesh::hospital
