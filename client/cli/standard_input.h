// Uploads from standard input; private to this folder.
#pragma once

#include <filesystem>
#include <memory>
#include <stop_token>
#include <vector>

#include "base/files.h"
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
                                                  UploadOptions& how, const std::stop_token& stop);

}  // namespace isomesh::cli
