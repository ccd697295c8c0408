#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcistrmf.h>
#include <dcmtk/dcmdata/dcostrma.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/dcmtrans.h>
#include <dcmtk/dcmnet/diutil.h>
#include <fcntl.h>

#include "base/descriptor.h"
#include "base/error.h"
#include "base/text.h"
#include "proto/dicom_uid.h"
#include "server/hospital/dimse/associations.h"
#include "server/hospital/dimse/daemon_channel.h"
#include "server/hospital/objects/data_set.h"
#include "server/process/child.h"
#include "server/volume/object_classes.h"

namespace isomesh::dimse {
namespace {

using dimse::DimseEnded;
using dimse::DimseObject;
using dimse::DimseReceiving;
using dimse::DimseRefusal;

// Transfer syntaxes that isomesh-import reads, in order of preference: objects are accepted as
// stored, and uncompressed ones cost the sender no time. DCMTK 3.6.7 has no names for some.
constexpr std::array kSyntaxes = {UID_LittleEndianExplicitTransferSyntax,
                                  UID_LittleEndianImplicitTransferSyntax,
                                  UID_BigEndianExplicitTransferSyntax,
                                  "1.2.840.10008.1.2.1.98",  // encapsulated uncompressed
                                  UID_JPEGLSLosslessTransferSyntax,
                                  UID_JPEG2000LosslessOnlyTransferSyntax,
                                  "1.2.840.10008.1.2.4.202",  // HTJ2K lossless, RPCL
                                  "1.2.840.10008.1.2.4.201",  // HTJ2K lossless
                                  "1.2.840.10008.1.2.4.110",  // JPEG XL lossless
                                  UID_JPEGProcess14SV1TransferSyntax,
                                  UID_JPEGProcess14TransferSyntax,
                                  UID_RLELosslessTransferSyntax,
                                  UID_DeflatedExplicitVRLittleEndianTransferSyntax,
                                  "1.2.840.10008.1.2.8.1",  // deflated frames
                                  UID_JPEG2000TransferSyntax,
                                  "1.2.840.10008.1.2.4.203",  // HTJ2K
                                  "1.2.840.10008.1.2.4.112",  // JPEG XL
                                  "1.2.840.10008.1.2.4.111",  // JPEG XL, recompressed JPEG
                                  UID_JPEGLSLossyTransferSyntax,
                                  UID_JPEGProcess2_4TransferSyntax,
                                  UID_JPEGProcess1TransferSyntax};

bool is_wanted(std::string_view abstract_syntax) {
  constexpr std::string_view kStorage = "1.2.840.10008.5.1.4.1.1.";
  if (abstract_syntax == UID_VerificationSOPClass) return true;
  return abstract_syntax.starts_with(kStorage) && !volume::kind_without_images(abstract_syntax);
}

// Null if the peer proposes none of our syntaxes.
const char* chosen_syntax(const T_ASC_PresentationContext& context) {
  for (const char* syntax : kSyntaxes) {
    for (int n = 0; n < context.transferSyntaxCount; ++n) {
      if (std::string_view(context.proposedTransferSyntaxes[n]) == syntax) return syntax;
    }
  }
  return nullptr;
}

OFCondition answer_proposals(T_ASC_Parameters* parameters) {
  const int count = ASC_countPresentationContexts(parameters);
  for (int position = 0; position < count; ++position) {
    T_ASC_PresentationContext context = {};
    OFCondition done = ASC_getPresentationContext(parameters, position, &context);
    if (done.bad()) return done;
    const auto id = context.presentationContextID;
    const char* syntax = chosen_syntax(context);
    if (!is_wanted(context.abstractSyntax)) {
      done = ASC_refusePresentationContext(parameters, id, ASC_P_ABSTRACTSYNTAXNOTSUPPORTED);
    } else if (syntax == nullptr) {
      done = ASC_refusePresentationContext(parameters, id, ASC_P_TRANSFERSYNTAXESNOTSUPPORTED);
    } else {
      done = ASC_acceptPresentationContext(parameters, id, syntax);
    }
    if (done.bad()) return done;
  }
  return EC_Normal;
}

bool is_among(const std::vector<std::string>& titles, const std::string& title) {
  return std::ranges::find(titles, title) != titles.end();
}

// Continues after write errors, so that the rest of the object is read from the connection and the
// sender gets a status. DCMTK's own file output would end the association.
class FileSink : public DcmConsumer {
 public:
  // Writes at most that many bytes.
  FileSink(const std::filesystem::path& path, std::uint64_t most_bytes);

  bool has_failed() const { return has_failed_; }

  OFBool good() const override { return OFTrue; }
  OFCondition status() const override { return EC_Normal; }
  OFBool isFlushed() const override { return OFTrue; }
  offile_off_t avail() const override { return kPieceBytes; }
  offile_off_t write(const void* bytes, offile_off_t count) override;
  void flush() override {}

 private:
  static constexpr offile_off_t kPieceBytes = 1 << 20;

  Descriptor file_;
  std::uint64_t room_;
  bool has_failed_ = false;
};

FileSink::FileSink(const std::filesystem::path& path, std::uint64_t most_bytes)
    : file_(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600)),
      room_(most_bytes),
      has_failed_(file_.number() < 0) {}

offile_off_t FileSink::write(const void* bytes, offile_off_t count) {
  const auto size = static_cast<std::size_t>(count);
  if (has_failed_) return count;
  if (size > room_) {
    has_failed_ = true;
    return count;
  }
  try {
    write_all(file_, std::span(static_cast<const std::byte*>(bytes), size));
    room_ -= size;
  } catch (const Error&) {
    has_failed_ = true;
  }
  return count;
}

// A stream of DCMTK that writes to a FileSink.
class FileStream : public DcmOutputStream {
 public:
  explicit FileStream(FileSink& sink) : DcmOutputStream(&sink) {}
};

class Association {
 public:
  explicit Association(const DimseReceiving& order) : order_(order) {}
  ~Association() {
    ASC_dropSCPAssociation(association_, 0);
    ASC_destroyAssociation(&association_);
    ASC_dropNetwork(&network_);
  }
  Association(const Association&) = delete;
  Association& operator=(const Association&) = delete;

  DimseEnded serve() {
    const DimseRefusal refusal = accept();
    if (refusal == DimseRefusal::kNone) answer_messages();
    const auto valid = [](const std::string& title) {
      return dimse::is_ae_title(title) ? title : "";
    };
    return {.refusal = refusal, .called = valid(called_), .calling = valid(calling_)};
  }

 private:
  DimseRefusal accept();
  void rename_syntaxes();
  DimseRefusal reject(DimseRefusal why, T_ASC_RejectParametersReason reason);
  void answer_messages();
  OFCondition store(T_ASC_PresentationContextID context_id, const T_DIMSE_C_StoreRQ& request);
  // The status of an object that was written to its file, behind a head.
  DIC_US status_of(const T_DIMSE_C_StoreRQ& request, const std::string& syntax,
                   std::size_t head_bytes);
  std::filesystem::path file() const { return order_.folder / std::to_string(count_); }
  int idle() const { return static_cast<int>(order_.idle.count()); }

  const DimseReceiving& order_;
  T_ASC_Network* network_ = nullptr;
  T_ASC_Association* association_ = nullptr;
  std::string called_;
  std::string calling_;
  std::map<T_ASC_PresentationContextID, std::string> syntaxes_;
  std::size_t count_ = 0;  // objects started so far
};

DimseRefusal Association::reject(DimseRefusal why, T_ASC_RejectParametersReason reason) {
  const T_ASC_RejectParameters rejection = {ASC_RESULT_REJECTEDPERMANENT, ASC_SOURCE_SERVICEUSER,
                                            reason};
  ASC_rejectAssociation(association_, &rejection);
  return why;
}

DimseRefusal Association::accept() {
  dcmSocketSendTimeout.set(idle());
  dcmSocketReceiveTimeout.set(idle());
  dcmDisableGethostbyaddr.set(OFTrue);
  dcmExternalSocketHandle.set(peer_socket());
  if (ASC_initializeNetwork(NET_ACCEPTOR, 0, idle(), &network_).bad()) return DimseRefusal::kOther;
  OFCondition done = ASC_receiveAssociation(network_, &association_, ASC_MAXIMUMPDUSIZE, nullptr,
                                            nullptr, OFFalse, DUL_NOBLOCK, idle());
  if (done.bad()) return DimseRefusal::kOther;
  std::array<char, 64> calling = {};
  std::array<char, 64> called = {};
  std::array<char, 64> responding = {};
  done = ASC_getAPTitles(association_->params, calling.data(), calling.size(), called.data(),
                         called.size(), responding.data(), responding.size());
  if (done.bad()) return reject(DimseRefusal::kOther, ASC_REASON_SU_NOREASON);
  calling_ = trimmed(calling.data());
  called_ = trimmed(called.data());
  if (!is_among(order_.called, called_)) {
    return reject(DimseRefusal::kCalled, ASC_REASON_SU_CALLEDAETITLENOTRECOGNIZED);
  }
  if (!is_among(order_.calling, calling_)) {
    return reject(DimseRefusal::kCalling, ASC_REASON_SU_CALLINGAETITLENOTRECOGNIZED);
  }
  done = answer_proposals(association_->params);
  if (done.good()) done = ASC_acknowledgeAssociation(association_);
  rename_syntaxes();
  return done.good() ? DimseRefusal::kNone : DimseRefusal::kOther;
}

// DCMTK ends associations for transfer syntaxes that it has no name for, though it only copies the
// bytes of data sets. So it gets the name of another one, in the list where it looks.
void Association::rename_syntaxes() {
  LST_HEAD** contexts = &association_->params->DULparams.requestedPresentationContext;
  auto* context = static_cast<DUL_PRESENTATIONCONTEXT*>(LST_Head(contexts));
  if (context != nullptr) LST_Position(contexts, context);
  while (context != nullptr) {
    syntaxes_[context->presentationContextID] = context->acceptedTransferSyntax;
    OFStandard::strlcpy(context->acceptedTransferSyntax, UID_LittleEndianExplicitTransferSyntax,
                        sizeof(context->acceptedTransferSyntax));
    context = static_cast<DUL_PRESENTATIONCONTEXT*>(LST_Next(contexts));
  }
}

void Association::answer_messages() {
  while (true) {
    T_DIMSE_Message message = {};
    T_ASC_PresentationContextID context = 0;
    OFCondition done =
        DIMSE_receiveCommand(association_, DIMSE_NONBLOCKING, idle(), &context, &message, nullptr);
    if (done == DUL_PEERREQUESTEDRELEASE) {
      ASC_acknowledgeRelease(association_);
      return;
    }
    if (done == DUL_PEERABORTEDASSOCIATION) return;
    if (done.good()) {
      if (message.CommandField == DIMSE_C_ECHO_RQ) {
        done = DIMSE_sendEchoResponse(association_, context, &message.msg.CEchoRQ, STATUS_Success,
                                      nullptr);
      } else if (message.CommandField == DIMSE_C_STORE_RQ) {
        done = store(context, message.msg.CStoreRQ);
      } else {
        done = DIMSE_BADCOMMANDTYPE;
      }
    }
    if (done.bad()) {
      ASC_abortAssociation(association_);
      return;
    }
  }
}

OFCondition Association::store(T_ASC_PresentationContextID context_id,
                               const T_DIMSE_C_StoreRQ& request) {
  T_ASC_PresentationContext context = {};
  OFCondition done =
      ASC_findAcceptedPresentationContext(association_->params, context_id, &context);
  if (done.bad()) return done;
  if (request.DataSetType == DIMSE_DATASET_NULL) return DIMSE_BADDATA;
  ++count_;
  FileSink sink(file(), order_.max_object_bytes);
  FileStream stream(sink);
  const std::string& syntax = syntaxes_.at(context_id);
  const std::string head =
      dicom::file_head(request.AffectedSOPClassUID, request.AffectedSOPInstanceUID, syntax);
  sink.write(head.data(), static_cast<offile_off_t>(head.size()));
  T_ASC_PresentationContextID data_context = context_id;
  done = DIMSE_receiveDataSetInFile(association_, DIMSE_NONBLOCKING, idle(), &data_context, &stream,
                                    nullptr, nullptr);
  if (done.bad()) return done;
  T_DIMSE_C_StoreRSP response = {};
  response.MessageIDBeingRespondedTo = request.MessageID;
  response.DataSetType = DIMSE_DATASET_NULL;
  response.DimseStatus = sink.has_failed() ? STATUS_STORE_Refused_OutOfResources
                                           : status_of(request, syntax, head.size());
  std::snprintf(response.AffectedSOPClassUID, sizeof(response.AffectedSOPClassUID), "%s",
                request.AffectedSOPClassUID);
  std::snprintf(response.AffectedSOPInstanceUID, sizeof(response.AffectedSOPInstanceUID), "%s",
                request.AffectedSOPInstanceUID);
  response.opts = O_STORE_AFFECTEDSOPCLASSUID | O_STORE_AFFECTEDSOPINSTANCEUID;
  std::error_code gone;  // the daemon has moved it into its store
  std::filesystem::remove(file(), gone);
  return DIMSE_sendStoreResponse(association_, context_id, &request, &response, nullptr);
}

DIC_US Association::status_of(const T_DIMSE_C_StoreRQ& request, const std::string& syntax,
                              std::size_t head_bytes) {
  // All that DCMTK has no name for are explicit and little-endian (PS3.5, A.4).
  const E_TransferSyntax known = DcmXfer(syntax.c_str()).getXfer();
  DcmInputFileStream stream(file().c_str(), static_cast<offile_off_t>(head_bytes));
  DcmDataset object;
  object.transferInit();
  const OFCondition done =
      object.readUntilTag(stream, known == EXS_Unknown ? EXS_LittleEndianExplicit : known,
                          EGL_noChange, DCM_MaxReadLength, DCM_StudyID);
  object.transferEnd();
  if (done.bad()) return STATUS_STORE_Error_CannotUnderstand;
  const auto uid_of = [&](const DcmTagKey& tag) {
    OFString uid;
    object.findAndGetOFString(tag, uid);
    return std::string(trimmed(uid.c_str()));
  };
  const DimseObject told = {.file = file().filename(),
                            .called = called_,
                            .calling = calling_,
                            .study = uid_of(DCM_StudyInstanceUID),
                            .series = uid_of(DCM_SeriesInstanceUID),
                            .instance = uid_of(DCM_SOPInstanceUID)};
  if (told.instance != request.AffectedSOPInstanceUID ||
      uid_of(DCM_SOPClassUID) != request.AffectedSOPClassUID || !is_uid(told.instance) ||
      !is_uid(told.study) || !is_uid(told.series)) {
    return STATUS_STORE_Error_DataSetDoesNotMatchSOPClass;
  }
  process::respond(dimse::to_line(told));
  return read_verdict() == dimse::DimseVerdict::kStored ? STATUS_Success
                                                        : STATUS_STORE_Refused_OutOfResources;
}

}  // namespace

DimseEnded receive_association(const DimseReceiving& order) { return Association(order).serve(); }

}  // namespace isomesh::dimse
