// What speaks to a hospital, as one wing of the service: orders, PACS, series that are received,
// the audit trail for a collector. The daemon is built without it when ISOMESH_HOSPITAL is off.
#pragma once

#include <filesystem>
#include <memory>

#include "server/http/app/wing.h"

namespace isomesh::hospital {

// The files that the file of --hospital names. Throws Error kInvalidParameter when it has a
// mistake. Touches nothing else.
http::ConfiguredFiles check(const std::filesystem::path& file);

// A wing that is not open when no file is given. Throws as check() does, and Error kUnavailable
// when it cannot listen for series.
std::unique_ptr<http::Wing> open(const http::WingSettings& settings,
                                 const http::WingServices& services);

}  // namespace isomesh::hospital
