// The groups of options of the commands, and the examples that help texts show. Private to this
// folder.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "client/cli/options.h"
#include "proto/types.h"

namespace CLI {
class App;
}

namespace isomesh::cli {

// Throws EarlyExit for a command or an option that `app` does not have. The library would report
// "FILE: 30 does not exist" for "--isoo 30". Also rejects options that `local` has no use for.
void check_names(const CLI::App& app, int argc, const char* const* argv);

inline constexpr const char* kUploadGroup = "Upload";
inline constexpr const char* kRawGroup = "Raw samples";

// The kinds of objects that the argument FILE may name.
enum class Inputs { kFiles, kFilesAndVolumes };

// FILE and the options that select a volume in it.
void add_file(CLI::App& app, Options& options, Inputs inputs = Inputs::kFiles);

void add_raw(CLI::App& app, Options& options);

// The values of -o and --format as they were given.
struct GivenOutputs {
  std::vector<std::string> paths = {};
  std::vector<MeshFormat> formats = {};  // of --format
};

void add_outputs(CLI::App& app, GivenOutputs& given);

// The files to write: those that -o names, and one of each format in a folder. Throws EarlyExit for
// unknown suffixes, missing folders and formats that no output uses.
std::vector<Output> outputs_from(const GivenOutputs& given);

// Commands that write files take the formats from -o instead of an option of their own.
enum class Formats { kAsOption, kByFiles };

// How the parameters are sent: a query carries only those with `in_query`.
enum class Carrier { kBody, kQuery };

// Adds an option for each parameter, which sets its member of `parameters`.
void add_parameters(CLI::App& app, JobParameters& parameters, Formats formats,
                    Carrier carrier = Carrier::kBody);

// The error's text with the options' names instead of the fields': "--max-error" for
// "max_error_mm".
std::string in_options(const Error& error);

// The overview's examples, one per line, indented by two blanks.
std::string general_examples();

// The examples of one subcommand in the same form; empty if it has none.
std::string examples_of(std::string_view command);

}  // namespace isomesh::cli
