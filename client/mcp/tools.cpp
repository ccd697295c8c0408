#include "client/mcp/tools.h"

#include <algorithm>
#include <set>
#include <string_view>
#include <utility>

#include "base/base64.h"
#include "base/files.h"
#include "base/ids.h"
#include "base/text.h"
#include "client/cli/console.h"
#include "client/cli/run_folder.h"
#include "client/mcp/schema.h"
#include "proto/empty_surface.h"
#include "proto/json.h"
#include "proto/types.h"

namespace isomesh::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kScheme = "isomesh://jobs/";

McpJson text_schema(const char* description) {
  return {{"type", "string"}, {"description", description}};
}

McpJson list_schema(const char* description) {
  return {{"type", "array"}, {"items", {{"type", "string"}}}, {"description", description}};
}

McpJson flag_schema(const char* description) {
  return {{"type", "boolean"}, {"description", description}};
}

McpJson number_schema(const char* description) {
  return {{"type", "integer"}, {"description", description}};
}

template <class T>
std::optional<T> argument(const McpJson& arguments, const char* name) {
  const auto found = arguments.find(name);
  if (found == arguments.end() || found->is_null()) return std::nullopt;
  try {
    return found->template get<T>();
  } catch (const McpJson::exception&) {
    throw invalid_parameter(name, "has the wrong type");
  }
}

std::string text_of(const McpJson& arguments, const char* name) {
  return argument<std::string>(arguments, name).value_or("");
}

// Throws Error kInvalidParameter if `name` is given beside one of `others`, which would be ignored.
void check_alone(const McpJson& arguments, const char* name,
                 const std::vector<std::string>& others) {
  const auto is_given = [&](const std::string& which) {
    const auto found = arguments.find(which);
    return found != arguments.end() && *found != nullptr && *found != "" && *found != false &&
           *found != McpJson::array();
  };
  if (!is_given(name)) return;
  for (const std::string& other : others) {
    if (is_given(other))
      throw invalid_parameter(other, std::string("cannot be given with ") + name);
  }
}

std::vector<std::string> names_in(const McpJson& object) {
  std::vector<std::string> names;
  for (const auto& [name, value] : object.items()) names.push_back(name);
  return names;
}

// The path of a file below the folder, with its links resolved. Throws Error kInvalidParameter for
// any other.
fs::path in_folder(const std::string& path, const fs::path& folder) {
  // The system reads a path up to there.
  if (path.find('\0') != std::string::npos) {
    throw Error(ErrorCode::kInvalidParameter, "a path must not have the character U+0000");
  }
  std::error_code error;
  const fs::path whole = fs::weakly_canonical(folder / path, error);
  const auto [end, unused] = std::ranges::mismatch(folder, whole);
  if (error || end != folder.end()) {
    throw Error(ErrorCode::kInvalidParameter,
                path + ": is not in the folder that this program may use (isomesh mcp --folder)");
  }
  return whole;
}

struct OutputFile {
  fs::path path;
  MeshFormat format;
};

// No file that it brings with it may exist either.
OutputFile output_of(const std::string& name, const fs::path& folder, bool is_by_labels) {
  const fs::path path = in_folder(name, folder);
  const std::string suffix = lower(path.extension().string());
  const auto format = from_string<MeshFormat>(suffix.empty() ? suffix : suffix.substr(1));
  if (!format) {
    throw Error(ErrorCode::kInvalidParameter,
                name + ": must end in the name of a format: " + names_of<MeshFormat>());
  }
  std::error_code error;
  for (const fs::path& file : files_of_mesh(path, *format, is_by_labels)) {
    if (!fs::exists(fs::symlink_status(file, error))) continue;
    const std::string what =
        file == path ? name : name + ": its materials " + file.filename().string();
    throw Error(ErrorCode::kInvalidParameter, what + ": exists already; choose another name");
  }
  return {path, *format};
}

std::vector<OutputFile> outputs_of(const McpJson& arguments, const fs::path& folder,
                                   bool is_by_labels) {
  std::vector<OutputFile> outputs;
  std::set<fs::path> written;
  for (const std::string& name : argument<std::vector<std::string>>(arguments, "output")
                                     .value_or(std::vector<std::string>())) {
    outputs.push_back(output_of(name, folder, is_by_labels));
    const OutputFile& output = outputs.back();
    for (const fs::path& file : files_of_mesh(output.path, output.format, is_by_labels)) {
      if (written.insert(file).second) continue;
      throw Error(ErrorCode::kInvalidParameter,
                  name + ": another output writes " + file.filename().string());
    }
  }
  return outputs;
}

McpJson upload_properties() {
  return {{"files", list_schema("Paths of the volume: a file, a folder of DICOM slices, or files "
                                "that belong together")},
          {"name", text_schema("Name of the volume")},
          {"series", text_schema("UID of the DICOM series, if the files have several")},
          {"member", text_schema("The file to use, if a folder or archive has several volumes")},
          {"masks", flag_schema("The files are masks of one structure each: make one volume of "
                                "labels of them")},
          {"volume_index", number_schema("The volume to use, from 0, if the file has several")},
          {"accept", list_schema("Codes of problems to accept; an error names them")}};
}

Volume uploaded(const McpJson& arguments, const ToolCall& call) {
  std::vector<fs::path> paths;
  for (const std::string& file : argument<std::vector<std::string>>(arguments, "files")
                                     .value_or(std::vector<std::string>())) {
    paths.push_back(in_folder(file, call.folder));
  }
  if (paths.empty()) throw invalid_parameter("files", "must name a file");
  UploadOptions how;
  how.name = text_of(arguments, "name");
  how.series = text_of(arguments, "series");
  how.member = text_of(arguments, "member");
  how.masks = argument<bool>(arguments, "masks").value_or(false);
  how.volume = argument<std::uint32_t>(arguments, "volume_index");
  how.accept =
      argument<std::vector<std::string>>(arguments, "accept").value_or(std::vector<std::string>());
  how.progress = [&call](std::uint64_t done, std::uint64_t total) {
    if (total > 0)
      call.report(0.3 * static_cast<double>(done) / static_cast<double>(total), "upload");
  };
  std::vector<UploadedVolume> volumes = call.client.upload_all(paths, how);
  if (volumes.size() != 1) throw several_volumes(volumes);
  return *volumes.front().volume;
}

McpJson upload(const McpJson& arguments, const ToolCall& call) {
  return McpJson::parse(to_json(uploaded(arguments, call)));
}

McpJson asked(const ToolCall& call, std::vector<std::string> path,
              std::vector<std::pair<std::string, std::string>> query = {},
              const char* method = "GET") {
  std::erase_if(query, [](const auto& pair) { return pair.second.empty(); });
  const std::string body =
      call.client.ask({.method = method, .path = std::move(path), .query = std::move(query)});
  McpJson response = parse_json<McpJson>(body, nullptr, false);
  if (response.is_object()) return response;
  throw Error(ErrorCode::kInternal, "the server's response does not match the API");
}

McpJson volumes(const McpJson& arguments, const ToolCall& call) {
  return asked(call, {"/v1/volumes"}, {{"cursor", text_of(arguments, "cursor")}});
}

McpJson info(const McpJson& arguments, const ToolCall& call) {
  return asked(call, {"/v1/volumes", text_of(arguments, "volume")});
}

McpJson labels(const McpJson& arguments, const ToolCall& call) {
  const std::string job = text_of(arguments, "job");
  const std::string volume = text_of(arguments, "volume");
  if (job.empty() == volume.empty()) {
    throw Error(ErrorCode::kInvalidParameter, "give either a volume or a job");
  }
  return asked(call, {job.empty() ? "/v1/volumes" : "/v1/jobs", job + volume, "labels"},
               {{"cursor", text_of(arguments, "cursor")}});
}

McpJson jobs(const McpJson& arguments, const ToolCall& call) {
  check_alone(arguments, "job", {"state", "volume", "cursor"});
  const std::string job = text_of(arguments, "job");
  if (!job.empty()) return asked(call, {"/v1/jobs", job});
  return asked(call, {"/v1/jobs"},
               {{"state", text_of(arguments, "state")},
                {"volume", text_of(arguments, "volume")},
                {"cursor", text_of(arguments, "cursor")}});
}

McpJson cancel(const McpJson& arguments, const ToolCall& call) {
  return McpJson::parse(to_json(call.client.cancel(text_of(arguments, "job"))));
}

// The job when it has succeeded. A call that is cancelled cancels the job, too; the key finds it if
// its response had not come yet.
Job made(const JobParameters& parameters, const ToolCall& call) {
  constexpr std::size_t kKeyBytes = 16;
  const std::string key = random_hex(kKeyBytes);
  try {
    const std::string id = call.client.submit(parameters, key).id;
    Job job = call.client.wait(id, [&](const Job& seen) {
      call.report(0.3 + 0.7 * seen.progress, std::string(to_string(seen.stage)));
    });
    if (job.error) throw to_error(*job.error);
    if (job.state == JobState::kSucceeded) return job;
    throw Error(ErrorCode::kUnusableVolume, "the job " + id + " was cancelled");
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kCancelled) {
      Client parting = parting_client(call.options);
      parting.cancel(parting.submit(parameters, key).id);
    }
    throw;
  }
}

void check_surface(const Job& job, const McpJson& arguments) {
  if (!job.mesh || !job.mesh->empty) return;
  if (argument<bool>(arguments, "allow_empty").value_or(false)) return;
  throw empty_surface(*job.mesh, "allow_empty accepts that");
}

void write(const std::string& job, const std::vector<OutputFile>& outputs,
           std::optional<std::int64_t> label, const ToolCall& call) {
  for (const OutputFile& output : outputs) {
    call.client.fetch(job, output.format, output.path, {}, label, Existing::kRefuse);
  }
}

McpJson mesh(const McpJson& arguments, const ToolCall& call) {
  check_alone(arguments, "volume", names_in(upload_properties()));
  McpJson body = argument<McpJson>(arguments, "parameters").value_or(McpJson::object());
  if (!body.is_object()) throw invalid_parameter("parameters", "must be an object");
  for (const char* const own : {"volume", "formats", "callback"}) {
    if (body.contains(own)) throw invalid_parameter(own, "is not one of `parameters` here");
  }
  const bool are_masks = argument<bool>(arguments, "masks").value_or(false);
  if (are_masks && !body.contains("iso") && !body.contains("labels")) body["labels"] = "all";
  const std::vector<OutputFile> outputs =
      outputs_of(arguments, call.folder, body.contains("labels"));
  std::vector<std::string> formats;
  for (const OutputFile& output : outputs) {
    const std::string name(to_string(output.format));
    if (std::ranges::find(formats, name) == formats.end()) formats.push_back(name);
  }
  if (formats.empty()) formats.emplace_back("glb");
  body["formats"] = formats;
  // As `isomesh mesh`: programs on a desktop do not open Draco.
  const bool has_glb = std::ranges::find(formats, "glb") != formats.end();
  if (has_glb && !body.contains("glb_codec")) body["glb_codec"] = "none";
  body["volume"] = "any";
  JobParameters parameters = parse_job_parameters(body.dump());  // before anything is sent
  const std::string volume = text_of(arguments, "volume");
  parameters.volume = volume.empty() ? uploaded(arguments, call).id : volume;
  const Job job = made(parameters, call);
  check_surface(job, arguments);
  write(job.id, outputs, std::nullopt, call);
  return McpJson::parse(to_json(job));
}

McpJson fetch(const McpJson& arguments, const ToolCall& call) {
  const auto label = argument<std::int64_t>(arguments, "label");
  const Job job = call.client.job(text_of(arguments, "job"));
  const bool is_by_labels = !label && job.parameters.labels;
  const std::vector<OutputFile> outputs = outputs_of(arguments, call.folder, is_by_labels);
  if (outputs.empty()) throw invalid_parameter("output", "must name a file");
  check_surface(job, arguments);
  write(job.id, outputs, label, call);
  McpJson files = McpJson::array();
  for (const OutputFile& output : outputs) {
    files.push_back({{"file", output.path.lexically_relative(call.folder).string()},
                     {"bytes", fs::file_size(output.path)}});
  }
  return {{"files", files}};
}

std::vector<Tool> make_tools() {
  const McpJson cursor = text_schema("The page after this one: `next` of the page before");
  const McpJson job = text_schema("Id of a job");
  const McpJson volume = text_schema("Id of a stored volume");
  const McpJson output = list_schema(
      "New files for the mesh; the suffix selects the format: .glb .stl .ply .obj .3mf .vtp ...");
  McpJson of_mesh = upload_properties();
  of_mesh["volume"] = text_schema("Id of a stored volume, instead of files");
  of_mesh["parameters"] = job_schema();
  of_mesh["parameters"]["description"] =
      "Give `iso` for a scan, or `labels` (\"all\" or a list of numbers) for a segmentation";
  of_mesh["output"] = output;
  const McpJson allow_empty = flag_schema("An empty surface is no error");
  of_mesh["allow_empty"] = allow_empty;
  return {
      {"upload",
       "Stores a medical volume (DICOM, NIfTI, NRRD, ...) on the isomesh server and describes it. "
       "Notes say what was decided, and errors say which argument helps.",
       false,
       upload_properties(),
       {"files"},
       upload},
      {"volumes", "Lists the stored volumes.", true, {{"cursor", cursor}}, {}, volumes},
      {"info",
       "Describes a stored volume: size, spacing in mm, range of the samples, suggested iso-value, "
       "named iso-values, notes.",
       true,
       {{"volume", volume}},
       {"volume"},
       info},
      {"mesh",
       "Makes the surface of a volume, waits for it, and writes it to files. The result has the "
       "numbers of triangles and components, area and volume, and links to the mesh.",
       false,
       of_mesh,
       {},
       mesh},
      {"labels",
       "Lists the labels of a segmentation (volume), or the surfaces of each label (job).",
       true,
       {{"volume", volume}, {"job", job}, {"cursor", cursor}},
       {},
       labels},
      {"jobs",
       "Shows one job, or lists jobs, the newest first.",
       true,
       {{"job", job},
        {"state", {{"type", "string"}, {"enum", name_list<JobState>()}}},
        {"volume", volume},
        {"cursor", cursor}},
       {},
       jobs},
      {"cancel", "Cancels a job.", false, {{"job", job}}, {"job"}, cancel},
      {"fetch",
       "Writes the mesh of a finished job to files, or the surface of one of its labels.",
       false,
       {{"job", job},
        {"output", output},
        {"label", number_schema("One label's own surface")},
        {"allow_empty", allow_empty}},
       {"job", "output"},
       fetch}};
}

std::string media_type_of(std::string_view format) {
  if (format == "glb") return "model/gltf-binary";
  for (const std::string_view known : {"stl", "obj", "3mf"}) {
    if (format == known) return "model/" + std::string(known);
  }
  return "application/octet-stream";
}

McpJson link_of(const std::string& job, const std::string& format) {
  return {{"uri", std::string(kScheme) + job + "/mesh." + format},
          {"name", "mesh." + format + " of " + job},
          {"mimeType", media_type_of(format)}};
}

}  // namespace

McpJson Tool::schema() const {
  McpJson schema = {{"type", "object"}, {"properties", properties}};
  if (properties.is_null()) schema["properties"] = McpJson::object();
  if (!required.empty()) schema["required"] = required;
  schema["additionalProperties"] = false;
  return schema;
}

const std::vector<Tool>& tools() {
  static const std::vector<Tool> all = make_tools();
  return all;
}

McpJson run_tool(const Tool& tool, const McpJson& arguments, const ToolCall& call) {
  for (const auto& [name, value] : arguments.items()) {
    if (!tool.properties.contains(name)) {
      throw invalid_parameter(name, std::string("is no argument of ") + tool.name);
    }
  }
  for (const std::string& name : tool.required) {
    if (!arguments.contains(name)) throw invalid_parameter(name, "is required");
    if (arguments[name].is_string() && arguments[name].get_ref<const std::string&>().empty()) {
      throw invalid_parameter(name, "is empty");
    }
  }
  return tool.run(arguments, call);
}

std::vector<McpJson> resource_links(const McpJson& job) {
  std::vector<McpJson> links;
  const McpJson::json_pointer files("/mesh/files");
  if (!job.contains("id") || !job.contains(files)) return links;
  for (const auto& [format, file] : job[files].items()) {
    links.push_back(link_of(job["id"].get<std::string>(), format));
    links.back()["size"] = file.value("bytes", std::uint64_t{0});
  }
  return links;
}

McpJson list_resources(Client& client) {
  McpJson resources = McpJson::array();
  for (const Job& job : client.jobs({.state = JobState::kSucceeded}).jobs) {
    for (McpJson& link : resource_links(McpJson::parse(to_json(job)))) {
      resources.push_back(std::move(link));
    }
  }
  return {{"resources", resources}};
}

McpJson read_resource(const std::string& uri, Client& client) {
  const Error unknown(ErrorCode::kNotFound, "there is no resource " + in_quotes(uri) +
                                                "; meshes are isomesh://jobs/ID/mesh.FORMAT");
  constexpr std::string_view kMesh = "/mesh.";
  const std::size_t at = uri.find(kMesh);
  if (!uri.starts_with(kScheme) || at == std::string::npos) throw unknown;
  const std::string id = uri.substr(kScheme.size(), at - kScheme.size());
  const auto format = from_string<MeshFormat>(uri.substr(at + kMesh.size()));
  if (id.empty() || !format) throw unknown;
  const Job job = client.job(id);
  const auto file = job.mesh ? job.mesh->files.find(*format) : decltype(job.mesh->files.end()){};
  if (!job.mesh || file == job.mesh->files.end()) throw unknown;
  if (file->second.bytes > kMostResourceBytes) {
    throw Error(ErrorCode::kTooLarge,
                "the mesh has " + std::to_string(file->second.bytes) +
                    " bytes, more than the 16 MiB that a message may carry; the tool fetch writes "
                    "it to a file");
  }
  const RunFolder folder;
  const fs::path path = folder.path() / "mesh";
  client.fetch(id, *format, path);
  return {{"contents",
           {{{"uri", uri},
             {"mimeType", media_type_of(to_string(*format))},
             {"blob", to_base64(std::string_view(read_whole(path)))}}}}};
}

}  // namespace isomesh::cli
