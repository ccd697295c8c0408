// What a query says about a body that is a volume. Free functions, thread safe; what is malformed
// or unknown throws Error kInvalidParameter that names the parameter.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "proto/types.h"
#include "server/http/requests/request.h"
#include "server/process/import_message.h"

namespace isomesh::http {

// Raw samples' description from `dims`, `type` and the rest; empty without `dims`.
std::optional<RawDescription> raw_description_of(const Request& request);

// Raw samples' description, what to take of several series, members or volumes, what to accept.
process::ImportOptions import_options_of(const Request& request);

// The names of the parameters that import_options_of reads.
const std::set<std::string>& import_parameters();

// What a Content-Disposition header (RFC 6266) calls a file, in UTF-8, without folders and control
// characters and not longer than a name may be; empty where it tells none.
std::string file_name_of(std::string_view content_disposition);

// The same of a name that stands by itself.
std::string plain_file_name(std::string_view name);

}  // namespace isomesh::http
