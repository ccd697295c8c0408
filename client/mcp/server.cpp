#include "client/mcp/server.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <iostream>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include <poll.h>
#include <unistd.h>

#include "client/cli/console.h"
#include "client/cli/exit_status.h"
#include "client/mcp/tools.h"
#include "proto/error.h"
#include "proto/json_tree.h"

namespace isomesh::cli {
namespace {

constexpr std::array<std::string_view, 3> kRevisions = {"2025-06-18", "2025-03-26", "2024-11-05"};
constexpr std::size_t kLongestLine = std::size_t{1} << 20;
constexpr std::size_t kMostWaiting = 100;
constexpr std::chrono::milliseconds kPollTime{500};

// JSON-RPC 2.0, section 5.1; MCP's own for a resource that there is not.
enum Code : int {
  kParseError = -32700,
  kInvalidRequest = -32600,
  kMethodNotFound = -32601,
  kInvalidParams = -32602,
  kInternalError = -32603,
  kBusy = -32000,
  kNoResource = -32002,
};

// An error of the protocol; those of a tool are its result.
struct RpcError {
  int code;
  std::string message;
};

// The error, and what helps against it.
std::string words_of(const Error& error) {
  constexpr std::size_t kMostChoices = 20;
  std::string text = error.what();
  for (const FieldError& field : error.fields()) {
    if (text.find(field.field) == std::string::npos)
      text += ' ' + field.field + ": " + field.message;
  }
  const Remedy& remedy = error.remedy();
  if (!remedy.overridable.empty())
    text += " To go on, add \"" + remedy.overridable + "\" to accept.";
  for (std::size_t at = 0; at < std::min(remedy.choices.size(), kMostChoices); ++at) {
    const Choice& choice = remedy.choices[at];
    // A job has an argument of this name.
    const std::string name = choice.parameter == "volume" ? "volume_index" : choice.parameter;
    text +=
        (at == 0 ? " Choices: " : "; ") + name + " = " + choice.value + " (" + choice.title + ')';
  }
  return text;
}

// A request that is done on the other thread.
struct Waiting {
  McpJson id;
  std::string method;
  McpJson params;
  std::stop_source stop;
};

class Server {
 public:
  Server(const Options& options, std::filesystem::path folder)
      : options_(options), folder_(std::move(folder)), worker_([this] { work(); }) {}
  ~Server() {
    {
      const std::scoped_lock lock(mutex_);
      is_over_ = true;
      queue_.clear();
      if (current_) current_->stop.request_stop();
    }
    changed_.notify_all();
  }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // A line without its end.
  void take(std::string_view line) {
    McpJson message = parse_json<McpJson>(line, nullptr, false);
    if (message.is_discarded()) return fail(nullptr, {kParseError, "this is not JSON"});
    McpJson id = nullptr;
    try {
      id = checked_id(message);
      answer(std::move(id), message);
    } catch (const RpcError& error) {
      fail(id_of(message), error);
    } catch (const McpJson::exception&) {
      fail(id_of(message), {kInvalidParams, "a member has the wrong type"});
    }
  }

  void refuse_long_line() {
    fail(nullptr, {kInvalidRequest, "a message has at most 1048576 bytes"});
  }

  // Waits for what was asked, after the end of the input. Calls `pause` meanwhile, which may throw.
  template <class Pause>
  void finish(const Pause& pause) {
    std::unique_lock lock(mutex_);
    while (!changed_.wait_for(lock, kPollTime, [this] { return queue_.empty() && !current_; })) {
      pause();
    }
  }

 private:
  static McpJson id_of(const McpJson& message) {
    if (!message.is_object() || !message.contains("id")) return nullptr;
    const McpJson& id = message["id"];
    return id.is_string() || id.is_number_integer() ? id : McpJson(nullptr);
  }

  // Null for a notification.
  static McpJson checked_id(const McpJson& message) {
    const bool is_message =
        message.is_object() && message.contains("jsonrpc") && message["jsonrpc"] == "2.0";
    if (!is_message) throw RpcError{kInvalidRequest, "this is not a message of JSON-RPC 2.0"};
    if (!message.contains("id")) return nullptr;
    McpJson id = id_of(message);
    if (id.is_null()) throw RpcError{kInvalidRequest, "an id is a text or a whole number"};
    return id;
  }

  void answer(McpJson id, const McpJson& message) {
    if (!message.contains("method")) {
      // A response; this server sends no requests.
      if (message.contains("result") || message.contains("error")) return;
      throw RpcError{kInvalidRequest, "the method is missing"};
    }
    const auto method = message["method"].get<std::string>();
    const McpJson params = message.value("params", McpJson::object());
    if (!params.is_object()) throw RpcError{kInvalidParams, "params must be an object"};
    if (id.is_null()) {
      if (method == "notifications/cancelled") stop(params.value("requestId", McpJson()));
      return;
    }
    if (method == "initialize") return succeed(id, initialized(params));
    if (method == "ping") return succeed(id, McpJson::object());
    if (method == "tools/list") return succeed(id, list_tools());
    if (method == "resources/templates/list") return succeed(id, templates());
    const bool takes_time =
        method == "tools/call" || method == "resources/list" || method == "resources/read";
    if (!takes_time) throw RpcError{kMethodNotFound, "there is no method " + method};
    if (method == "tools/call") tool_of(params);
    enqueue({std::move(id), method, params, {}});
  }

  static McpJson initialized(const McpJson& params) {
    const auto asked = params.value("protocolVersion", std::string());
    const bool is_known = std::ranges::find(kRevisions, asked) != kRevisions.end();
    return {
        {"protocolVersion", is_known ? asked : std::string(kRevisions.front())},
        {"capabilities", {{"tools", McpJson::object()}, {"resources", McpJson::object()}}},
        {"serverInfo", {{"name", "isomesh"}, {"title", "isomesh"}, {"version", ISOMESH_VERSION}}},
        {"instructions",
         "Makes surface meshes of medical volumes. Not a medical device. Upload a volume, look "
         "at its range and notes, choose an iso-value or labels, then mesh it."}};
  }

  static McpJson list_tools() {
    McpJson all = McpJson::array();
    for (const Tool& tool : tools()) {
      all.push_back({{"name", tool.name},
                     {"description", tool.description},
                     {"inputSchema", tool.schema()},
                     {"annotations", {{"readOnlyHint", tool.is_read_only}}}});
    }
    return {{"tools", all}};
  }

  static McpJson templates() {
    const McpJson mesh = {{"uriTemplate", "isomesh://jobs/{job}/mesh.{format}"},
                          {"name", "mesh"},
                          {"description", "A mesh of a finished job, up to 16 MiB"}};
    return {{"resourceTemplates", McpJson::array({mesh})}};
  }

  static const Tool& tool_of(const McpJson& params) {
    const auto name = params.value("name", std::string());
    const auto found =
        std::ranges::find_if(tools(), [&](const Tool& each) { return each.name == name; });
    if (found == tools().end()) throw RpcError{kInvalidParams, "there is no tool " + name};
    if (!params.value("arguments", McpJson::object()).is_object()) {
      throw RpcError{kInvalidParams, "arguments must be an object"};
    }
    return *found;
  }

  void enqueue(Waiting request) {
    {
      const std::scoped_lock lock(mutex_);
      if (queue_.size() >= kMostWaiting) throw RpcError{kBusy, "too many requests are waiting"};
      queue_.push_back(std::move(request));
    }
    changed_.notify_all();
  }

  // A request that is cancelled gets no response.
  void stop(const McpJson& id) {
    const std::scoped_lock lock(mutex_);
    std::erase_if(queue_, [&](const Waiting& each) { return each.id == id; });
    if (current_ && current_->id == id) current_->stop.request_stop();
  }

  void work() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [this] { return is_over_ || !queue_.empty(); });
      if (is_over_) return;
      current_ = std::move(queue_.front());
      queue_.pop_front();
      const Waiting request = *current_;  // the other thread reads `current_`
      lock.unlock();
      do_it(request);
      lock.lock();
      current_.reset();
      changed_.notify_all();
    }
  }

  void do_it(const Waiting& request) {
    const auto is_stopped = [&] { return request.stop.stop_requested(); };
    try {
      Client client = client_of(options_, request.stop.get_token());
      McpJson result = request.method == "tools/call"       ? call_of(request, client)
                       : request.method == "resources/list" ? list_resources(client)
                                                            : read(request.params, client);
      if (!is_stopped()) succeed(request.id, std::move(result));
    } catch (const RpcError& error) {
      if (!is_stopped()) fail(request.id, error);
    } catch (const Error& error) {
      const bool is_missing = error.code() == ErrorCode::kNotFound;
      if (!is_stopped()) {
        fail(request.id, {is_missing ? kNoResource : kInternalError, words_of(error)});
      }
    } catch (const McpJson::exception&) {
      fail(request.id, {kInvalidParams, "a member has the wrong type"});
    } catch (const std::exception& error) {
      fail(request.id, {kInternalError, error.what()});
    }
  }

  static McpJson read(const McpJson& params, Client& client) {
    const auto uri = params.value("uri", std::string());
    if (uri.empty()) throw RpcError{kInvalidParams, "uri is required"};
    return read_resource(uri, client);
  }

  McpJson call_of(const Waiting& request, Client& client) {
    const McpJson arguments = request.params.value("arguments", McpJson::object());
    const McpJson token =
        request.params.value("_meta", McpJson::object()).value("progressToken", McpJson());
    double last = -1;
    const ToolCall call{
        .client = client,
        .options = options_,
        .folder = folder_,
        .report = [&](double progress, const std::string& stage) {
          if (token.is_null() || progress <= last) return;  // it must increase
          last = progress;
          notify(
              "notifications/progress",
              {{"progressToken", token}, {"progress", progress}, {"total", 1}, {"message", stage}});
        }};
    try {
      const McpJson result = run_tool(tool_of(request.params), arguments, call);
      McpJson content = McpJson::array({text_content(dump(result))});
      for (McpJson& link : resource_links(result)) {
        link["type"] = "resource_link";
        content.push_back(std::move(link));
      }
      return {{"content", content}, {"structuredContent", result}, {"isError", false}};
    } catch (const Error& error) {
      if (request.stop.stop_requested()) throw;
      return {{"content", McpJson::array({text_content(words_of(error))})}, {"isError", true}};
    }
  }

  static McpJson text_content(const std::string& text) {
    return {{"type", "text"}, {"text", text}};
  }

  void succeed(const McpJson& id, McpJson result) {
    send({{"jsonrpc", "2.0"}, {"id", id}, {"result", std::move(result)}});
  }
  void fail(const McpJson& id, const RpcError& error) {
    send({{"jsonrpc", "2.0"},
          {"id", id},
          {"error", {{"code", error.code}, {"message", error.message}}}});
  }
  void notify(const char* method, McpJson params) {
    send({{"jsonrpc", "2.0"}, {"method", method}, {"params", std::move(params)}});
  }

  void send(const McpJson& message) {
    const std::string line = dump(message) + '\n';
    const std::scoped_lock lock(output_);
    std::cout << line << std::flush;
  }

  const Options& options_;
  const std::filesystem::path folder_;
  std::mutex output_;
  std::mutex mutex_;  // of the members below
  std::condition_variable changed_;
  std::deque<Waiting> queue_;
  std::optional<Waiting> current_;
  bool is_over_ = false;
  std::jthread worker_;  // last, so that it ends first
};

// Calls take(line) for each line of standard input, and refuse() for one that is too long, until it
// ends. `pause` is called while there is none, and may throw.
template <class Take, class Refuse, class Pause>
void for_each_line(const Take& take, const Refuse& refuse, const Pause& pause) {
  std::string line;
  bool is_too_long = false;
  const auto end_line = [&] {
    if (is_too_long) {
      refuse();
    } else if (line.find_first_not_of(" \t\r") != std::string::npos) {
      take(line);
    }
    line.clear();
    is_too_long = false;
  };
  std::array<char, 65536> piece;
  while (true) {
    pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
    if (::poll(&input, 1, static_cast<int>(kPollTime.count())) == 0) {
      pause();
      continue;
    }
    const ssize_t count = ::read(STDIN_FILENO, piece.data(), piece.size());
    if (count < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (count <= 0) break;
    for (const char letter : std::string_view(piece.data(), static_cast<std::size_t>(count))) {
      if (letter == '\n') {
        end_line();
        continue;
      }
      is_too_long = is_too_long || line.size() == kLongestLine;
      if (!is_too_long) line += letter;
    }
  }
  end_line();
}

}  // namespace

int serve_mcp(const Options& options, const Client& client, const std::filesystem::path& folder) {
  Server server(options, folder);
  const auto pause = [&] { client.pause(std::chrono::milliseconds{0}); };  // throws after a signal
  try {
    for_each_line([&](const std::string& line) { server.take(line); },
                  [&] { server.refuse_long_line(); }, pause);
    server.finish(pause);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCancelled) throw;
  }
  return kDone;
}

}  // namespace isomesh::cli
