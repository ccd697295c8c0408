// The files of certificates, keys and passwords that are configured.
#pragma once

#include "server/http/app/wing.h"
#include "server/options.h"

namespace isomesh {

using http::ConfiguredFiles;

// The files that the URL of --store names. libpq does without some of them if they are missing.
ConfiguredFiles files_of_store(const Options& options);

// Throws Error kInvalidParameter that names each file which cannot be read: of the files that
// options name, and of `others`.
void check_configured_files(const Options& options, const ConfiguredFiles& others = {});

}  // namespace isomesh
