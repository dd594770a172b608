/* Arrays of many states, seen from vector lanes: MBS_LANES states side by side. */
#ifndef MBS_ROWS_H
#define MBS_ROWS_H

#include <string.h>

#include "lanes.h"

/* Element (state, k) of an array stands at at[state * row + k * column]. `stream`: 1 to store past
 * the caches, for which `at` is aligned to 64 bytes. */
typedef struct {
  double *at;
  long long row, column, stream;
} mbs_port;

#define MBS_ALWAYS static inline __attribute__((always_inline, unused))

MBS_ALWAYS void mbs_store_past(double *to, mbs_lanes x) {
#if MBS_LANES == 8
  _mm512_stream_pd(to, (__m512d)x);
#elif MBS_LANES == 4
  _mm256_stream_pd(to, (__m256d)x);
#else
  memcpy(to, &x, sizeof x);
#endif
}

MBS_ALWAYS void mbs_store_end(void) {
#if MBS_LANES > 2
  _mm_sfence();
#endif
}

/* `count` numbers, at most MBS_LANES; nothing beyond them is touched. */
MBS_ALWAYS mbs_lanes mbs_load_part(const double *from, int count) {
  mbs_lanes x = {0};
#if MBS_LANES == 8
  x = (mbs_lanes)_mm512_maskz_loadu_pd((__mmask8)((1 << count) - 1), from);
#else
  memcpy(&x, from, (size_t)count * sizeof(double));
#endif
  return x;
}

MBS_ALWAYS void mbs_store_part(double *to, int count, mbs_lanes x) {
#if MBS_LANES == 8
  _mm512_mask_storeu_pd(to, (__mmask8)((1 << count) - 1), (__m512d)x);
#else
  memcpy(to, &x, (size_t)count * sizeof(double));
#endif
}

/* One state in all lanes. */
MBS_ALWAYS void mbs_take_same(const mbs_port *port, int size, mbs_lanes *lanes) {
  for (int k = 0; k < size; ++k) lanes[k] = mbs_all(port->at[k * port->column]);
}

MBS_ALWAYS void mbs_take_each(const mbs_port *port, long long first, int many, int size,
                              mbs_lanes *lanes) {
  for (int l = 0; l < MBS_LANES; ++l) {
    const double *from = port->at + (first + (l < many ? l : many - 1)) * port->row;
    for (int k = 0; k < size; ++k) lanes[k][l] = from[k * port->column];
  }
}

/* States first .. first + many - 1 into lanes; lanes beyond them repeat the last one. */
MBS_ALWAYS void mbs_take(const mbs_port *port, long long first, int many, int size,
                         mbs_lanes *lanes) {
#if defined(MBS_PAIR)
  if (many == MBS_LANES && port->row == 1) {
    const double *from = port->at + first;
    for (int k = 0; k < size; ++k) lanes[k] = *(const mbs_unaligned *)(from + k * port->column);
    return;
  }
  if (many == MBS_LANES && port->column == 1) {
    const double *from = port->at + first * port->row;
    for (int k = 0; k < size; k += MBS_LANES) {
      mbs_lanes square[MBS_LANES];
      const int left = size - k, count = left < MBS_LANES ? left : MBS_LANES;
      MBS_UNROLLED for (int l = 0; l < MBS_LANES; ++l) square[l] =
          count == MBS_LANES ? *(const mbs_unaligned *)(from + l * port->row + k)
                             : mbs_load_part(from + l * port->row + k, count);
      mbs_transpose(square);
      MBS_UNROLLED for (int j = 0; j < MBS_LANES; ++j) if (j < count) lanes[k + j] = square[j];
    }
    return;
  }
#endif
  mbs_take_each(port, first, many, size, lanes);
}

MBS_ALWAYS void mbs_give_each(const mbs_port *port, long long first, int many, int size,
                              const mbs_lanes *lanes) {
  for (int l = 0; l < many; ++l) {
    double *to = port->at + (first + l) * port->row;
    for (int k = 0; k < size; ++k) to[k * port->column] = lanes[k][l];
  }
}

#if defined(MBS_PAIR)
/* Full lanes to rows of a matrix. */
MBS_ALWAYS void mbs_give_rows(double *to, long long row, int size, const mbs_lanes *lanes) {
  for (int k = 0; k < size; k += MBS_LANES) {
    mbs_lanes square[MBS_LANES];
    const int left = size - k, count = left < MBS_LANES ? left : MBS_LANES;
    MBS_UNROLLED for (int j = 0; j < MBS_LANES; ++j) square[j] = j < count ? lanes[k + j] : mbs_all(0);
    mbs_transpose(square);
    MBS_UNROLLED for (int l = 0; l < MBS_LANES; ++l) {
      if (count == MBS_LANES)
        *(mbs_unaligned *)(to + l * row + k) = square[l];
      else
        mbs_store_part(to + l * row + k, count, square[l]);
    }
  }
}
#endif

/* Lanes to states first .. first + many - 1. */
MBS_ALWAYS void mbs_give(const mbs_port *port, long long first, int many, int size,
                         const mbs_lanes *lanes) {
#if defined(MBS_PAIR)
  if (many == MBS_LANES && port->row == 1) {
    double *to = port->at + first;
    if (port->stream)
      for (int k = 0; k < size; ++k) mbs_store_past(to + k * port->column, lanes[k]);
    else
      for (int k = 0; k < size; ++k) *(mbs_unaligned *)(to + k * port->column) = lanes[k];
    return;
  }
  if (many == MBS_LANES && port->column == 1) {
    double *to = port->at + first * port->row;
    if (port->stream) {
      mbs_lanes rows[size];
      mbs_give_rows((double *)rows, size, size, lanes);
      for (int k = 0; k < size; ++k) mbs_store_past(to + k * MBS_LANES, rows[k]);
    } else
      mbs_give_rows(to, port->row, size, lanes);
    return;
  }
#endif
  mbs_give_each(port, first, many, size, lanes);
}

#endif
