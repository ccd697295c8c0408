// The Model Context Protocol, revision 2025-06-18: JSON-RPC 2.0, a message a line. Private to this
// folder.
#pragma once

#include <filesystem>

#include "client/cli/options.h"

namespace isomesh::cli {

// Answers requests until standard input ends, or `client` is asked to stop. Returns the exit
// status. Calls of tools and reads of resources are done one after the other, on a thread of their
// own, so that others are answered meanwhile, and `notifications/cancelled` stops them.
int serve_mcp(const Options& options, const Client& client, const std::filesystem::path& folder);

}  // namespace isomesh::cli
