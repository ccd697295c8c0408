#include <algorithm>
#include <atomic>
#include <filesystem>
#include <set>
#include <thread>
#include <utility>

#include <sys/stat.h>

#include "client/cli/batch.h"
#include "client/cli/commands.h"
#include "client/cli/console.h"
#include "client/cli/mesh_run.h"
#include "client/cli/report.h"
#include "client/isomesh/package.h"

namespace isomesh::cli {
namespace {

int mesh_all(const Options& options, const std::vector<Input>& inputs, const std::stop_token& stop,
             TakenOutputs& taken, Leftovers& leftovers) {
  std::atomic<std::size_t> next = 0;
  std::atomic<int> worst = kDone;
  std::atomic<std::size_t> failed = 0;
  std::atomic<bool> is_lost = false;
  const auto fail = [&](const Error& error, const Input& input) {
    complain(error, input.names.name);
    if (options.json) {
      print(failure_json(error, {.input = input.files.front().string()}) + '\n');
    }
    return status_of(error);
  };
  const auto work = [&] {
    MeshRun run(options, stop, true, taken, leftovers);
    for (std::size_t at = next++; at < inputs.size() && !stop.stop_requested(); at = next++) {
      int status = kDone;
      try {
        status = run.input(inputs[at]);
      } catch (const Lost& error) {
        is_lost = true;
        status = fail(error, inputs[at]);
      } catch (const Error& error) {
        status = fail(error, inputs[at]);
      }
      if (status == kDone) continue;
      ++failed;
      for (int before = worst; status > before && !worst.compare_exchange_weak(before, status);) {
      }
    }
  };
  {
    std::vector<std::jthread> threads;
    const auto count = std::min<std::size_t>(static_cast<std::size_t>(options.jobs), inputs.size());
    for (std::size_t n = 1; n < count; ++n) threads.emplace_back(work);
    work();
  }
  if (stop.stop_requested()) return kRefused;
  if (failed > 0) {
    complain(std::to_string(failed) + " of " + std::to_string(inputs.size()) + " inputs failed");
  }
  if (worst == kServerUnreachable && !is_lost && !options.is_local) suggest_local();
  return worst;
}

// A mesh must not replace a file of a volume: .vtk, for one, is a format of both.
void refuse_to_overwrite(const std::vector<Input>& inputs, const Options& options) {
  std::set<std::pair<dev_t, ino_t>> sent;
  struct stat status = {};
  for (const Input& input : inputs) {
    for (const std::filesystem::path& path : input.files) {
      std::error_code absent;
      if (!std::filesystem::exists(path, absent)) continue;  // standard input, or a stored volume
      try {
        for (const PackedFile& file : files_of_upload(path)) {
          if (::stat(file.path.c_str(), &status) == 0) sent.emplace(status.st_dev, status.st_ino);
        }
      } catch (const Error&) {
        // The upload of this input tells it.
      }
    }
  }
  for (const Input& input : inputs) {
    for (const Output& output : filled(options.outputs, input.names)) {
      if (::stat(output.path.c_str(), &status) != 0) continue;
      if (sent.contains({status.st_dev, status.st_ino})) {
        wrong_usage("-o: the mesh would overwrite the volume " + output.path.string());
      }
    }
  }
}

// Leaves out the inputs whose outputs are newer.
void skip_existing(std::vector<Input>& inputs, const Options& options) {
  const std::size_t all = inputs.size();
  std::erase_if(inputs, [&](const Input& input) {
    const std::vector<Output> outputs = filled(options.outputs, input.names);
    if (!is_up_to_date(input, outputs)) return false;
    if (options.json) {
      print(skipped_json(paths_of(outputs), {.input = input.files.front().string()}) + '\n');
    }
    return true;
  });
  if (options.quiet) return;
  complain("skipped " + std::to_string(all - inputs.size()) + " of " + std::to_string(all) +
           (all == 1 ? " input, whose mesh is newer" : " inputs, whose meshes are newer"));
}

}  // namespace

int mesh(const Options& options, const std::stop_token& stop) {
  std::vector<Input> inputs = inputs_of(options);
  refuse_to_overwrite(inputs, options);
  const bool is_one = inputs.size() == 1;
  // An archive's members are known after its upload; by then other inputs have their names.
  TakenOutputs taken;
  for (const Input& input : inputs) taken.take(filled(options.outputs, input.names));
  if (options.skip_existing) skip_existing(inputs, options);
  if (inputs.empty()) return kDone;
  Leftovers leftovers(options);
  if (!is_one) return mesh_all(options, inputs, stop, taken, leftovers);
  return MeshRun(options, stop, false, taken, leftovers).input(inputs.front());
}

}  // namespace isomesh::cli
