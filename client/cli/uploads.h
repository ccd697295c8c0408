// Uploads, also from standard input; private to this folder.
#pragma once

#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "base/files.h"
#include "client/cli/options.h"
#include "client/cli/progress_bar.h"
#include "client/cli/run_folder.h"
#include "client/isomesh/client.h"

namespace isomesh::cli {

struct InputCopy {
  InputCopy() : file(folder.path(), ".volume") {}

  RunFolder folder;
  ScratchFile file;
};

// Copies standard input to a file, because an upload states its size first, and puts the file in
// the place of "-". A volume without a name is called "stdin". Null if "-" is not among the files.
// Throws Error kCancelled on a stop request.
std::unique_ptr<InputCopy> standard_input_as_file(std::vector<std::filesystem::path>& files,
                                                  const std::stop_token& stop);

// Uploads the files and reports the notes on the volumes. `subject` names the input if there are
// several.
std::vector<UploadedVolume> upload_all(Client& client, const Options& options,
                                       const std::vector<std::filesystem::path>& files,
                                       const UploadOptions& how, ProgressBar& bar,
                                       const std::string& subject = {});

}  // namespace isomesh::cli
