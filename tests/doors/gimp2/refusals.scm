; A plug-in that is killed; then what the plug-in refuses, and with which sentence. After checks.scm.

(define (refuses name picture doing)
  (with-picture picture
    (lambda (image layer)
      (fact name (refusal (lambda () (doing image layer))))
      (fact (string-append name "-layers") (car (gimp-image-get-layers image))))))

; The shell kills the plug-in as soon as the program runs.
(let-program-be "slow")
(refuses "cancelled" "rgb.png" (lambda (image layer) (lay image layer '(evals 2000000000))))
(let-program-be "real")
(refuses "missed" "rgb.png"
  (lambda (image layer)
    (gimp-image-resize image 400 400 0 0)
    (gimp-image-select-rectangle image CHANNEL-OP-REPLACE 300 300 50 50)
    (lay image layer)))
(refuses "floating" "rgb.png"
  (lambda (image layer)
    (gimp-image-select-rectangle image CHANNEL-OP-REPLACE 10 10 50 50)
    (lay image (car (gimp-selection-float layer 0 0)))))
(refuses "group" "rgb.png"
  (lambda (image layer)
    (let ((group (car (gimp-layer-group-new image))))
      (gimp-image-insert-layer image group 0 0)
      (lay image group))))
(refuses "mask" "rgb.png"
  (lambda (image layer)
    (let ((mask (car (gimp-layer-create-mask layer ADD-MASK-WHITE))))
      (gimp-layer-add-mask layer mask)
      (lay image mask))))
(refuses "channel" "rgb.png"
  (lambda (image layer)
    (let ((channel (car (gimp-channel-new image 20 20 "channel" 50 '(0 0 0)))))
      (gimp-image-insert-channel image channel 0 0)
      (lay image channel))))
(refuses "locked" "rgb.png"
  (lambda (image layer)
    (gimp-item-set-lock-content layer TRUE)
    (lay image layer '(new-layer 0))))
(refuses "clear" "clear.png" lay)
(refuses "count" "rgb.png" (lambda (image layer) (plug-in-smalti RUN-NONINTERACTIVE image layer "mosaic")))
(refuses "style" "rgb.png" (lambda (image layer) (lay image layer '(style "cubist"))))
(refuses "shape" "rgb.png" (lambda (image layer) (lay image layer '(mask "star"))))
(refuses "grout" "rgb.png" (lambda (image layer) (lay image layer '(grout "mud"))))
(refuses "tiles" "rgb.png" (lambda (image layer) (lay image layer '(tiles 1000001))))
(refuses "seed" "rgb.png" (lambda (image layer) (lay image layer '(seed -1))))
(refuses "evals" "rgb.png" (lambda (image layer) (lay image layer '(evals -1))))
(refuses "size" "rgb.png" (lambda (image layer) (lay image layer '(size 15))))
(refuses "scale" "rgb.png" (lambda (image layer) (lay image layer '(scale 16.5))))
(refuses "new-layer" "rgb.png" (lambda (image layer) (lay image layer '(new-layer 2))))
(refuses "wide" "long.png" (lambda (image layer) (lay image layer '(scale 16))))

(define (with-program kind)
  (let-program-be kind)
  (refuses (string-append "program-" kind) "large.png" lay))
(with-program "old")
(with-program "stranger")
(with-program "failing")
(with-program "silent")
(with-program "garbled")
(with-program "killed")

(images-left "images-after-refusals")
(close-output-port facts)
