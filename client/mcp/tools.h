// The tools for a program with a language model. Private to this folder.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/options.h"
#include "proto/json_text.h"

namespace isomesh::cli {

using McpJson = nlohmann::ordered_json;

// One call: its client stops when the call is cancelled.
struct ToolCall {
  Client& client;
  const Options& options;
  const std::filesystem::path& folder;  // canonical; all files lie below it
  std::function<void(double progress, const std::string& stage)> report;
};

struct Tool {
  const char* name;
  const char* description;
  bool is_read_only;   // changes nothing on the server and writes no file
  McpJson properties;  // the schemas of its arguments
  std::vector<std::string> required;
  // Returns one object. Throws Error for wrong arguments and as Client does.
  std::function<McpJson(const McpJson& arguments, const ToolCall& call)> run;

  McpJson schema() const;
};

const std::vector<Tool>& tools();

// Throws Error kInvalidParameter for arguments that the tool does not have, or that are missing.
McpJson run_tool(const Tool& tool, const McpJson& arguments, const ToolCall& call);

// The meshes of the newest jobs that succeeded, and one mesh's bytes in base64. Throws Error
// kNotFound for another URI, kTooLarge beyond kMostResourceBytes, and as Client does.
McpJson list_resources(Client& client);
McpJson read_resource(const std::string& uri, Client& client);
inline constexpr std::uint64_t kMostResourceBytes = std::uint64_t{16} << 20;

// Links to the meshes of a job, as results of tools hold them.
std::vector<McpJson> resource_links(const McpJson& job);

}  // namespace isomesh::cli
