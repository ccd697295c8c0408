#include "client/platforms/command.h"

#include <algorithm>
#include <iostream>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "base/text.h"
#include "client/cli/exit_status.h"
#include "client/cli/options.h"
#include "client/platforms/descriptions.h"

namespace isomesh::cli {
namespace {

struct ToolRequest {
  std::string platform;
  std::string image = "isomesh:" ISOMESH_VERSION;
  ToolTable table;
};

// Options of `local` that a platform sets itself, or that are for a terminal.
bool is_own(const std::string& name) {
  constexpr std::array kOwn = {"help",   "output",  "format",        "jobs",
                               "daemon", "dry-run", "skip-existing", "callback"};
  return std::ranges::find(kOwn, name) != kOwn.end();
}

std::vector<ToolOption> options_of(const CLI::App& local) {
  std::vector<ToolOption> options;
  for (const CLI::Option* option : local.get_options()) {
    if (option->get_lnames().empty() || is_own(option->get_lnames().front())) continue;
    options.push_back(
        {.name = option->get_lnames().front(),
         .help = option->get_description(),
         .is_flag = option->get_items_expected_max() == 0,
         .is_repeated = option->get_multi_option_policy() == CLI::MultiOptionPolicy::TakeAll});
  }
  return options;
}

// The name stands in the descriptions as it is, some of which are programs.
std::string wrong_image(const std::string& image) {
  const auto is_of_name = [](char c) { return is_plain(c) || c == '/' || c == ':' || c == '@'; };
  const bool is_name =
      !image.empty() && is_letter_or_digit(image.front()) && std::ranges::all_of(image, is_of_name);
  return is_name ? "" : '"' + image + "\" is not the name of an image, such as isomesh:1";
}

std::string titles() {
  std::string text;
  for (const Platform& platform : kPlatforms) {
    text += (text.empty() ? "" : "; ") + std::string(platform.name) + ": " +
            std::string(platform.title);
  }
  return text;
}

}  // namespace

Added platform_commands() {
  const auto request = std::make_shared<ToolRequest>();
  Added added;
  added.commands = {
      {.name = "tool",
       .help = "Print a description of isomesh local for a platform that runs containers",
       .examples = R"(  isomesh tool cwl > isomesh.cwl
  isomesh tool xnat --image registry.example/isomesh:1 > command.json
)",
       .add_options =
           [request](CLI::App& app, Options& /*options*/) {
             std::vector<std::string> names;
             for (const Platform& platform : kPlatforms) names.emplace_back(platform.name);
             app.add_option("PLATFORM", request->platform, titles())
                 ->required()
                 ->type_name("PLATFORM")
                 ->check(CLI::IsMember(names));
             app.add_option("--image", request->image,
                            "The container image, which has isomesh in its PATH")
                 ->type_name("IMAGE")
                 ->check(wrong_image)
                 ->capture_default_str();
             // All commands have been added before one is parsed.
             app.parse_complete_callback([request, parent = app.get_parent()] {
               request->table = {request->image, options_of(*parent->get_subcommand("local"))};
             });
           },
       .run =
           [request](Client& /*client*/, const Options& /*options*/) {
             const auto* platform =
                 std::ranges::find(kPlatforms, request->platform, &Platform::name);
             std::cout << platform->describe(request->table);
             return kDone;
           }}};
  return added;
}

}  // namespace isomesh::cli
