// The query of a request whose body is a volume. Free functions, thread safe. They throw Error
// kInvalidParameter with the parameter's name for malformed or unknown values.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "proto/types.h"
#include "server/http/requests/request.h"
#include "server/import/message/import_message.h"
#include "server/import/message/upload_name.h"

namespace isomesh::http {

using import::ImportOptions;

// The description of raw samples from `dims`, `type` and others; empty without `dims`.
std::optional<RawDescription> raw_description_of(const Request& request);

// The description of raw samples, the selection among several series, members or volumes, and
// accepted ambiguities.
ImportOptions import_options_of(const Request& request);

// The names of the parameters that import_options_of reads.
const std::set<std::string>& import_parameters();

// Those of a query.
Parameters import_parameters_in(const Parameters& query);

// The name in a Content-Disposition header (RFC 6266), in UTF-8, without control characters,
// truncated to the limit; empty if missing. The parameter `name` is a chosen one, `filename` the
// file's, whose folders are removed.
import::UploadName upload_name_of(std::string_view content_disposition);

// The same for a plain name.
std::string plain_file_name(std::string_view name);

}  // namespace isomesh::http
