/* ARMOR's controller: a state and an incurred cost in, a bounded action out.
 *
 *   static _Alignas(ARMOR_CONTROLLER_ALIGN) uint8_t memory[ARMOR_CONTROLLER_SIZE];
 *   ArmorController *controller;
 *   if (armor_golden_replay(memory, sizeof memory, image, image_len) != ARMOR_STATUS_OK) ...
 *   if (armor_controller_init(memory, sizeof memory, image, image_len, 20.0f, 1, &controller) ...
 *   for (;;) {
 *       sense(state, &incurred);
 *       ArmorStatus status = armor_step(controller, state, STATE, incurred, &step);
 *       act(step.action);
 *   }
 *
 * The image lies at ARMOR_IMAGE_ALIGN and is read in place. A controller is used
 * by one thread or interrupt at a time; nothing here allocates, blocks or panics.
 */

#ifndef ARMOR_H
#define ARMOR_H

/* Made by cbindgen from armor-infer/src/capi; do not edit. */

#include <stddef.h>
#include <stdint.h>

/* A controller in the caller's memory. It reads its image in place for as long
 * as it is used, and has nothing to be released. */
typedef struct ArmorController ArmorController;

/*
 Most entries of a state vector.
 */
#define ARMOR_STATE_MAX 96

/*
 Most entries of an action vector.
 */
#define ARMOR_ACTION_MAX 8

/*
 Most units of a layer.
 */
#define ARMOR_HIDDEN_MAX 256

/*
 Most chains of a policy.
 */
#define ARMOR_RUNGS_MAX 8

/*
 Bytes that hold a controller on every machine.
 */
#define ARMOR_CONTROLLER_SIZE 6144

/*
 Alignment of these bytes.
 */
#define ARMOR_CONTROLLER_ALIGN 16

/*
 Alignment of an image in memory.
 */
#define ARMOR_IMAGE_ALIGN 16

/*
 What became of a call. A number keeps its meaning; new ones are added.
 */
enum ArmorStatus
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   It did what it says.
   */
  ARMOR_STATUS_OK = 0,
  /*
   A pointer is null.
   */
  ARMOR_STATUS_NULL_POINTER = 1,
  /*
   A pointer does not lie on the boundary that its type asks for.
   */
  ARMOR_STATUS_MISALIGNED_POINTER = 2,
  /*
   The memory is shorter than ARMOR_CONTROLLER_SIZE.
   */
  ARMOR_STATUS_MEMORY_TOO_SMALL = 3,
  /*
   The cost limit is negative, NaN, infinite, or 65536 and more.
   */
  ARMOR_STATUS_INVALID_LIMIT = 4,
  /*
   There are fewer bytes than the image's header says.
   */
  ARMOR_STATUS_IMAGE_TRUNCATED = 10,
  /*
   The image does not start on a boundary of ARMOR_IMAGE_ALIGN bytes.
   */
  ARMOR_STATUS_IMAGE_MISALIGNED = 11,
  /*
   The bytes are no policy image.
   */
  ARMOR_STATUS_IMAGE_MAGIC = 12,
  /*
   The image has another format version.
   */
  ARMOR_STATUS_IMAGE_VERSION = 13,
  /*
   The image's header is damaged.
   */
  ARMOR_STATUS_IMAGE_HEADER = 14,
  /*
   The image is damaged.
   */
  ARMOR_STATUS_IMAGE_CHECKSUM = 15,
  /*
   The image's manifest cannot be decoded.
   */
  ARMOR_STATUS_IMAGE_MANIFEST = 16,
  /*
   A dimension is zero or beyond the format's limits.
   */
  ARMOR_STATUS_IMAGE_SHAPE = 17,
  /*
   The image has no valid denoising chain.
   */
  ARMOR_STATUS_IMAGE_CHAIN = 18,
  /*
   The image has no valid scale of the cost budget.
   */
  ARMOR_STATUS_IMAGE_KAPPA_RANGE = 19,
  /*
   The image has no valid map from the cost budget.
   */
  ARMOR_STATUS_IMAGE_BUDGET_MAP = 20,
  /*
   A section of the image is missing, misplaced or of the wrong length.
   */
  ARMOR_STATUS_IMAGE_SECTION = 21,
  /*
   A section of the image holds a NaN or an infinity.
   */
  ARMOR_STATUS_IMAGE_NOT_FINITE = 22,
  /*
   A section of the image holds a number out of its range.
   */
  ARMOR_STATUS_IMAGE_OUT_OF_RANGE = 23,
  /*
   The image has reversed action bounds or a fallback action outside them.
   */
  ARMOR_STATUS_IMAGE_BOUNDS = 24,
  /*
   The policy has more than ARMOR_STATE_MAX state entries.
   */
  ARMOR_STATUS_LOAD_STATE_CAPACITY = 40,
  /*
   The policy has more than ARMOR_ACTION_MAX action entries.
   */
  ARMOR_STATUS_LOAD_ACTION_CAPACITY = 41,
  /*
   The policy has a layer of more than ARMOR_HIDDEN_MAX units.
   */
  ARMOR_STATUS_LOAD_HIDDEN_CAPACITY = 42,
  /*
   The cost limit lies above every budget that the policy was trained with.
   */
  ARMOR_STATUS_LOAD_LIMIT_ABOVE_TRAINED_RANGE = 43,
  /*
   The library was built without the number format of the policy.
   */
  ARMOR_STATUS_LOAD_PRECISION = 44,
  /*
   The image has no critic to choose among candidates by.
   */
  ARMOR_STATUS_LOAD_NO_CRITIC = 45,
  /*
   The image has no golden trace.
   */
  ARMOR_STATUS_GOLDEN_EMPTY = 60,
  /*
   This machine's budget is not that of the golden trace.
   */
  ARMOR_STATUS_GOLDEN_KAPPA = 61,
  /*
   This machine's action is not that of the golden trace.
   */
  ARMOR_STATUS_GOLDEN_ACTION = 62,
  /*
   The state has not the policy's length; the action is the fallback.
   */
  ARMOR_STATUS_STEP_STATE_LENGTH = 80,
  /*
   The state holds a NaN or an infinity; the action is the fallback.
   */
  ARMOR_STATUS_STEP_STATE_NOT_FINITE = 81,
  /*
   The incurred cost was negative, NaN or infinite; the whole budget was
   charged, and the action is the policy's at kappa 0.
   */
  ARMOR_STATUS_STEP_INVALID_COST = 82,
  /*
   Every chain takes more steps than the call allowed; the action is the fallback.
   */
  ARMOR_STATUS_STEP_NO_RUNG = 83,
  /*
   The network met or answered a NaN or an infinity; the action is the fallback.
   */
  ARMOR_STATUS_STEP_ACTION_NOT_FINITE = 84,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum ArmorStatus ArmorStatus;
#else
typedef int32_t ArmorStatus;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 The number format of a policy.
 */
enum ArmorPrecision
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   IEEE-754 single precision.
   */
  ARMOR_PRECISION_F32 = 0,
  /*
   8-bit weights, 15-bit activations.
   */
  ARMOR_PRECISION_INT16X8 = 1,
  /*
   8-bit weights, 7-bit activations.
   */
  ARMOR_PRECISION_INT8 = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum ArmorPrecision ArmorPrecision;
#else
typedef int32_t ArmorPrecision;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 What an image says of itself.
 */
typedef struct {
  /*
   The task that the policy was trained for: UTF-8 within the image, not terminated.
   */
  const char *task;
  /*
   Bytes of `task`.
   */
  size_t task_len;
  /*
   Bytes of the image, without what follows it in memory.
   */
  size_t image_len;
  /*
   Number format of weights and activations.
   */
  ArmorPrecision precision;
  /*
   Largest cost limit that the policy may be given, in units of cost.
   */
  float cost_limit_max;
  /*
   Entries of the state vector.
   */
  uint16_t state;
  /*
   Entries of the action vector.
   */
  uint16_t action;
  /*
   Units of a hidden layer.
   */
  uint16_t hidden;
  /*
   Chains of the policy.
   */
  uint16_t rungs;
  /*
   Calls of the denoiser that each chain takes, longest first; 0 beyond `rungs`.
   */
  uint16_t rung_steps[ARMOR_RUNGS_MAX];
} ArmorInfo;

/*
 The answer to a control step.
 */
typedef struct {
  /*
   What to do, within the policy's bounds; entries beyond its action dimension are 0.
   */
  float action[ARMOR_ACTION_MAX];
  /*
   The budget left after the incurred cost was charged, in units of cost.
   */
  float kappa;
  /*
   Which of the policy's chains flew, from 0; -1 where the action is the fallback.
   */
  int32_t rung;
} ArmorStep;





#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 Checks an image and tells what it holds.

 # Safety
 `image` leads to `image_len` bytes and `info` to an `ArmorInfo`.
 */
ArmorStatus armor_image_inspect(const uint8_t *image, size_t image_len, ArmorInfo *info);

/*
 Proves that this machine computes what the exporting one computed: flies the
 image's own trace and compares every bit. Takes `memory` as
 `armor_controller_init` does, and leaves it free. A policy whose trace does
 not replay must not fly.

 # Safety
 `memory` leads to `memory_len` bytes of nobody else's, `image` to `image_len` bytes.
 */
ArmorStatus armor_golden_replay(void *memory,
                                size_t memory_len,
                                const uint8_t *image,
                                size_t image_len);

/*
 Makes a controller in `memory` and points `out` to it, at the start of an
 episode that may incur `cost_limit` units of cost; `seed` decides the noise.
 Where it fails, `out` is null, which every other function answers with a status.

 # Safety
 `memory` leads to `memory_len` bytes of nobody else's, `image` to `image_len`
 bytes that stay as they are, both for as long as the controller is used;
 `out` leads to a pointer.
 */
ArmorStatus armor_controller_init(void *memory,
                                  size_t memory_len,
                                  const uint8_t *image,
                                  size_t image_len,
                                  float cost_limit,
                                  uint64_t seed,
                                  ArmorController **out);

/*
 Starts a new episode: the only way to refill the budget. Where it fails, the
 episode before goes on.

 # Safety
 `controller` is null or what `armor_controller_init` gave.
 */
ArmorStatus armor_new_episode(ArmorController *controller, float cost_limit, uint64_t seed);

/*
 One control step by the policy's longest chain: charges `incurred`, the cost
 of the step before (0 on the first), then answers `state` with an action.

 `step` is filled whatever the status is, unless `controller` or `step` itself
 is null or misaligned: a fault takes the fallback action, but for
 ARMOR_STATUS_STEP_INVALID_COST, which charges the whole budget and acts.

 # Safety
 `controller` is null or what `armor_controller_init` gave, `state` leads to
 `state_len` numbers and `step` to an `ArmorStep`.
 */
ArmorStatus armor_step(ArmorController *controller,
                       const float *state,
                       size_t state_len,
                       float incurred,
                       ArmorStep *step);

/*
 As `armor_step`, by the longest chain of at most `max_steps` calls of the
 denoiser: the caller knows how many its deadline leaves time for.

 # Safety
 As of `armor_step`.
 */
ArmorStatus armor_step_within(ArmorController *controller,
                              const float *state,
                              size_t state_len,
                              float incurred,
                              size_t max_steps,
                              ArmorStep *step);

/*
 What is left of the budget, in units of cost; 0 of no controller.

 # Safety
 `controller` is null or what `armor_controller_init` gave.
 */
float armor_kappa(const ArmorController *controller);

/*
 What a status (`ArmorStatus`) means, and what to do about it: one line of
 ASCII that lives as long as the program.
 */
const char *armor_status_text(int32_t status);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ARMOR_H */
