#include "base/error.h"

#include <cerrno>
#include <system_error>

#include "base/text.h"

namespace isomesh {

Error invalid_parameter(const std::string& field, const std::string& message) {
  return invalid_parameters({{field, message}});
}

Error invalid_parameters(std::vector<FieldError> fields) {
  std::string detail;
  for (FieldError& fault : fields) {
    fault.field = printable(fault.field);  // a client may choose any name
    if (!detail.empty()) detail += "; ";
    detail.append(fault.field).append(": ").append(fault.message);
  }
  return {ErrorCode::kInvalidParameter, detail, std::move(fields)};
}

void throw_system_error(std::string_view call, int error_number) {
  if (error_number == ENOSPC || error_number == EDQUOT || error_number == EFBIG) {
    throw Error(ErrorCode::kOutOfSpace, "there is no space left on the disk");
  }
  if (error_number == EMFILE || error_number == ENFILE || error_number == ENOMEM ||
      error_number == ENOBUFS || error_number == EAGAIN) {
    throw Error(ErrorCode::kUnavailable, "the service is out of file descriptors or memory");
  }
  throw Error(ErrorCode::kInternal,
              std::string(call) + ": " + std::generic_category().message(error_number));
}

void throw_file_error(std::string_view call, int error_number) {
  if (error_number == ENOENT) throw Error(ErrorCode::kNotFound, "the file does not exist");
  throw_system_error(call, error_number);
}

}  // namespace isomesh
